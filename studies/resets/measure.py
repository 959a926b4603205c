"""Simulate resets after casts and keep how they scatter the start: the virtual rig draws from it.

python -m studies.resets.measure cable=cable1   # for a cable whose `truth` or reset has changed
"""

from dataclasses import replace
from functools import partial

import numpy as np
import polars as pl
from omegaconf import DictConfig
from scipy.interpolate import CubicSpline

from robotcast.build import action_space, build, build_rig
from robotcast.casts.plan import PlannedCast, plan_action
from robotcast.casts.reset import ResetSettings, plan_reset
from robotcast.files import write_text
from robotcast.processes import parallel_map
from robotcast.rigs.collect import choose_casts
from robotcast.rigs.envelope import feasible_actions
from robotcast.rigs.virtual.cable import Motion, StartScatter, packaged_path
from robotcast.rigs.virtual.rig import VirtualRig
from robotcast.stage import bar, stage, tell

STRAIGHT = StartScatter(np.array([0.0, 1.0]), np.zeros((3, 2)))  # along +x, before any reset
PLACES = np.linspace(0.0, 1.0, 7)  # along the cable, whose headings after a reset are kept


def simulate_reset(
    rig: VirtualRig, planned: PlannedCast, number: int, settings: ResetSettings
) -> Motion:
    """Simulate cast `number` and the reset that follows it; return the reset's motion."""
    run, path = rig.begin(planned, number)
    run.drive(path, moving_s=planned.end_s)
    length_m, height_m = rig.cable.length_m + rig.truth.endpoint_radius_m, rig.cable.radius_m
    settings = replace(settings, held_height_m=height_m)
    motion = plan_reset(run.held[[0, 1, 3]], length_m, r0_m=rig.r0_m, settings=settings)
    place, yaw, pitch = motion.position_m - [0.0, 0.0, height_m], motion.yaw_rad, -motion.pitch_rad
    held = CubicSpline(motion.t_s, np.column_stack([place, yaw, pitch]), bc_type="clamped")
    steps = np.arange(round(motion.t_s[-1] / rig.truth.step_s) + 1) * rig.truth.step_s
    return run.drive(held(steps), moving_s=float(motion.t_s[-1]))


def resting_headings(motion: Motion) -> np.ndarray:
    """Return the headings of the resting cable at `PLACES`, (7,) [rad]."""
    pieces = np.diff(motion.nodes_m[-1, :, :2], axis=0)
    headings = np.unwrap(np.arctan2(pieces[:, 1], pieces[:, 0]))
    middles = (np.arange(len(pieces)) + 0.5) / len(pieces)
    return np.interp(PLACES, middles, headings)


def _headings(
    rig: VirtualRig, settings: ResetSettings, cast: tuple[int, PlannedCast]
) -> np.ndarray:
    number, planned = cast
    return resting_headings(simulate_reset(rig, planned, number, settings))


def measure(config: DictConfig) -> None:
    rig, space = build_rig(config, scatter=STRAIGHT), action_space(config, "collected")
    chosen = choose_casts(feasible_actions(*space), config.resets, 0, config.seed)
    casts = [plan_action(action, r0_m=rig.r0_m, limits=space[2]) for _, action in chosen]
    headings, found = partial(_headings, rig, build(config.casts.reset)), []
    with bar(f"resets of {rig.cable.name}") as progress:
        for one in parallel_map(headings, enumerate(casts), rig.workers):
            found.append(one)
            progress(len(found), len(casts))
    headings_rad = np.array(found)
    columns = {f"heading_{place:g}": c for place, c in zip(PLACES, headings_rad.T, strict=True)}
    path = packaged_path(rig.cable.name)
    table = pl.DataFrame({"reset": np.arange(len(casts)), **columns})
    write_text(path, table.write_csv(float_precision=6))
    shown = ", ".join(f"{value:.1f}" for value in headings_rad.std(axis=0, ddof=1) * 1e3)
    tell(f"{path.name}: headings scatter by {shown} mrad from the hand to the free end")


if __name__ == "__main__":
    stage(measure)()
