"""D_sim: where a tuned simulator says that many casts come to rest (paper, "D_sim")."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from robotcast.casts.plan import PlannedCast
from robotcast.casts.tool_motion import ToolMotion
from robotcast.progress import Progress, silent
from robotcast.simulators.simulator import SimulatedCast, Simulator

ACTIONS_AT_ONCE = 4096  # planned and simulated together, which bounds the memory


@dataclass(frozen=True)
class Generated:
    """Simulated casts.

    Attributes
    ----------
    actions : ndarray of shape (n, 6).
    endpoints_m : ndarray of shape (n, 2); NaN where the run diverged.
    diverged : bool ndarray of shape (n,).
    """

    actions: np.ndarray
    endpoints_m: np.ndarray
    diverged: np.ndarray


def _exactly(told: ToolMotion) -> ToolMotion:
    return told


def generate_casts(
    simulator: Simulator,
    vector: np.ndarray,
    actions: np.ndarray,
    plan: Callable[[np.ndarray], Sequence[PlannedCast]],
    *,
    settle_s: float,
    follow: Callable[[ToolMotion], ToolMotion] = _exactly,
    progress: Progress = silent,
) -> Generated:
    """Simulate the planned casts of `actions` (n, 6) under one parameter vector.

    Parameters
    ----------
    plan : actions (m, 6) → their planned casts.
    settle_s : how long after the tool should stop the endpoint is read at the latest; a cable
        that rests earlier is not simulated further.
    follow : the motion that an arm is told → the one it makes (`Following.motion`).
    """
    endpoints_m = np.empty((len(actions), 2))
    diverged = np.empty(len(actions), dtype=bool)
    for first in range(0, len(actions), ACTIONS_AT_ONCE):
        part = slice(first, first + ACTIONS_AT_ONCE)
        casts = [
            SimulatedCast(follow(planned.tool), np.array([planned.end_s + settle_s]))
            for planned in plan(actions[part])
        ]
        prediction = simulator.simulate(
            casts, vector, progress=_part_of(progress, first, len(actions))
        )
        endpoints_m[part] = prediction.waypoints_m[0, :, 0]
        diverged[part] = prediction.diverged[0]
    return Generated(actions, endpoints_m, diverged)


def _part_of(progress: Progress, first: int, whole: int) -> Progress:
    def report(done: int, total: int, note: str = "") -> None:
        progress(first + done, whole, note)

    return report
