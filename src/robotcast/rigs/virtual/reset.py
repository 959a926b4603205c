"""Executing the full five-step reset on the virtual cable, to see how its result scatters."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import repeat

import numpy as np
from scipy.interpolate import CubicSpline

from robotcast.casts.plan import PlannedCast
from robotcast.casts.reset import ResetMotion, ResetSettings, plan_reset
from robotcast.processes import process_pool
from robotcast.progress import Progress, silent
from robotcast.rigs.virtual.drive import Motion
from robotcast.rigs.virtual.rig import VirtualRig
from robotcast.rigs.virtual.scatter import StartScatter

PLACES = np.linspace(0.0, 1.0, 7)


def simulate_reset(
    rig: VirtualRig, planned: PlannedCast, number: int, settings: ResetSettings
) -> Motion:
    """Simulate cast `number` and the reset that follows it; return the reset's motion."""
    run, path = rig.begin(planned, number)
    run.drive(path, moving_s=planned.end_s)
    settings = replace(settings, held_height_m=rig.cable.radius_m)
    motion = plan_reset(
        run.held[[0, 1, 3]],
        rig.cable.length_m + rig.truth.endpoint_radius_m,
        r0_m=rig.r0_m,
        settings=settings,
    )
    path = reset_path(motion, settings.held_height_m, rig.truth.step_s)
    return run.drive(path, moving_s=float(motion.t_s[-1]))


def measure_resets(
    rig: VirtualRig,
    casts: Sequence[PlannedCast],
    settings: ResetSettings,
    progress: Progress = silent,
) -> StartScatter:
    """Simulate each cast and the reset that follows it; return how the cable then lies."""
    headings = []
    with process_pool(rig.workers) as pool:
        motions = pool.map(simulate_reset, repeat(rig), casts, range(len(casts)), repeat(settings))
        for number, motion in enumerate(motions):
            progress(number + 1, len(casts))
            headings.append(resting_headings(motion))
    return StartScatter(PLACES, np.array(headings))


def reset_path(motion: ResetMotion, held_height_m: float, step_s: float) -> np.ndarray:
    """Return the held end's path (steps + 1, 5) for `CableRun.drive`."""
    poses = np.column_stack(
        [
            motion.position_m[:, :2],
            motion.position_m[:, 2] - held_height_m,
            motion.yaw_rad,
            -motion.pitch_rad,
        ]
    )
    steps = np.arange(round(motion.t_s[-1] / step_s) + 1) * step_s
    return CubicSpline(motion.t_s, poses, bc_type="clamped")(steps)


def resting_headings(motion: Motion) -> np.ndarray:
    """Return the headings of the resting cable at `PLACES`, (7,) [rad]."""
    pieces = np.diff(motion.nodes_m[-1, :, :2], axis=0)
    headings = np.unwrap(np.arctan2(pieces[:, 1], pieces[:, 0]))
    middles = (np.arange(len(pieces)) + 0.5) / len(pieces)
    return np.interp(PLACES, middles, headings)
