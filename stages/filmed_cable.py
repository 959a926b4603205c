"""What every rig is told of the cable and of the camera that films it."""

from typing import Any

from grids import plain_config
from omegaconf import DictConfig

from robotcast.measurements.measurement_set import Cable
from robotcast.vision.facts import TrackerFacts
from robotcast.vision.fiducials import FiducialBoard

WEIGHED = ("name", "length_m", "mass_kg", "radius_m", "endpoint_mass_kg")


def weighed_cable(config: DictConfig) -> Cable:
    """Return the configured cable as its owner measured it."""
    return Cable(**{name: config.cable[name] for name in WEIGHED})


def build_tracker(config: DictConfig) -> TrackerFacts:
    """Return what a session tells its tracker."""
    plain: Any = plain_config(config)
    camera = plain["camera"]
    board = FiducialBoard.along_edges(**camera["board"], **camera["fiducials"])
    return TrackerFacts.from_dict(
        {
            **camera["nominal"],
            "endpoint_radius_m": float(plain["cable"]["endpoint_radius_m"]),
            "exposure_s": camera["picture"]["exposure_s"],
            "endpoint_height_m": float(plain["cable"]["radius_m"]),
            "fiducials": board.as_dict(),
        }
    )
