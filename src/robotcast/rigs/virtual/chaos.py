"""Which casts are chaotic: a millimetre at the start moves the resting end by centimetres."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import repeat

import numpy as np

from robotcast.casts.plan import PlannedCast
from robotcast.processes import process_pool
from robotcast.progress import Progress, silent
from robotcast.rigs.virtual.chance import CastNoise
from robotcast.rigs.virtual.rig import VirtualRig

NUDGE_M = 0.001
CHAOTIC = 10.0
"""Amplification from which a cast is called chaotic."""


@dataclass(frozen=True)
class CastSensitivity:
    """How well a cast can be repeated.

    Attributes
    ----------
    amplification : how far the resting end moves when the free end starts `NUDGE_M` to the left
        or right, the larger of both, in units of `NUDGE_M`; nothing else differs.
    scatter_m : average deviation of the resting end over repeats with the rig's own chance, as
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
