"""Studies of the virtual rig: which casts are chaotic, and how resets scatter the start.

In a chaotic cast a millimetre at the start moves the resting end by centimetres.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import repeat

import numpy as np
from scipy.interpolate import CubicSpline

from robotcast.casts.plan import PlannedCast
from robotcast.casts.reset import ResetSettings, plan_reset
from robotcast.processes import process_pool
from robotcast.progress import Progress, silent
from robotcast.rigs.virtual.arm import CastNoise, StartScatter
from robotcast.rigs.virtual.cable import Motion
from robotcast.rigs.virtual.rig import VirtualRig

NUDGE_M = 0.001
CHAOTIC = 10.0
"""Amplification from which a cast is called chaotic."""
PLACES = np.linspace(0.0, 1.0, 7)


@dataclass(frozen=True)
class CastSensitivity:
    """How well a cast can be repeated.

    `amplification` is how far the resting end moves when the free end starts `NUDGE_M` to the
    left or right, the larger of both, in units of `NUDGE_M`; nothing else differs. `scatter_m` is
    the average deviation of the resting end over repeats with the rig's own chance, as
    `measurements.noise_floor` counts it.
    """

    amplification: float
    scatter_m: float

    @property
    def chaotic(self) -> bool:
        """Whether a millimetre at the start moves the end by a centimetre or more."""
        return self.amplification >= CHAOTIC


def amplification(rig: VirtualRig, planned: PlannedCast) -> float:
    """Return by how much a cast amplifies a nudge of its free end at the start."""
    quiet = replace(rig, noise=CastNoise(0.0, 0.0, 0.0, 0.0, 0.0))
    start = rig.scatter.mean(rig.truth.segments)
    turn = NUDGE_M / rig.cable.length_m
    ends = [
        quiet.simulate_truth(planned, 0, headings_rad=start + nudge).cable.end_m[-1]
        for nudge in (0.0, turn, -turn)
    ]
    return float(max(np.linalg.norm(end - ends[0]) for end in ends[1:]) / NUDGE_M)


def repeat_scatter_m(rig: VirtualRig, planned: PlannedCast, repeats: int) -> float:
    """Return the average deviation of the resting end over casts that repeat `planned`."""
    ends = np.array(
        [rig.simulate_truth(planned, number).cable.end_m[-1, :2] for number in range(repeats)]
    )
    deviations = np.linalg.norm(ends - ends.mean(axis=0), axis=1)
    return float(deviations.mean() * np.sqrt(repeats / (repeats - 1)))


def sensitivities(
    rig: VirtualRig, casts: Sequence[PlannedCast], repeats: int, progress: Progress = silent
) -> list[CastSensitivity]:
    """Return the sensitivity of each cast, simulated side by side."""
    found = []
    with process_pool(rig.workers) as pool:
        for one in pool.map(_sensitivity, repeat(rig), casts, repeat(repeats)):
            found.append(one)
            progress(len(found), len(casts))
    return found


def _sensitivity(rig: VirtualRig, planned: PlannedCast, repeats: int) -> CastSensitivity:
    return CastSensitivity(amplification(rig, planned), repeat_scatter_m(rig, planned, repeats))


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


def resting_headings(motion: Motion) -> np.ndarray:
    """Return the headings of the resting cable at `PLACES`, (7,) [rad]."""
    pieces = np.diff(motion.nodes_m[-1, :, :2], axis=0)
    headings = np.unwrap(np.arctan2(pieces[:, 1], pieces[:, 0]))
    middles = (np.arange(len(pieces)) + 0.5) / len(pieces)
    return np.interp(PLACES, middles, headings)
