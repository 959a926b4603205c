"""Revisions of one cable's model: the base, and one with an effect."""

from dataclasses import replace

from robotcast.tuning.tuned import ModelRevision

BASE = ModelRevision(
    cable="cable1", rig="virtual", split="aaaa", tuning_casts=20, heldout_casts=30,
    simulator="segmented", optimizer="de", effects=(), tuning_waypoint_error_percent=2.46,
    heldout_waypoint_error_percent=3.12, heldout_final_error_percent=4.05,
    standard_error_percent=0.24, noise_floor_percent=0.76, simulated_casts=14000,
)  # fmt: skip
TILT = replace(
    BASE, effects=("board_tilt",), heldout_waypoint_error_percent=1.04,
    tuning_waypoint_error_percent=0.97, predicted_waypoint_error_percent=1.31,
    sizes={"board_tilt.sy": {"value": -0.0249, "unit": "1"}},
)  # fmt: skip
