"""D_sim: where a tuned simulator says that many casts come to rest (paper, "D_sim")."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from robotcast.casts.action import action_factors
from robotcast.casts.plan import PlannedCast
from robotcast.casts.tool_motion import ToolMotion
from robotcast.progress import Progress, silent
from robotcast.simulators.simulator import Cast, SimulatedCast, Simulator

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
    reach_m: np.ndarray | None = None,
    progress: Progress = silent,
) -> Generated:
    """Simulate the planned casts of `actions` (n, 6) under one parameter vector.

    Parameters
    ----------
    plan : actions (m, 6) → their planned casts.
    settle_s : how long after the tool should stop the endpoint is read at the latest; a cable
        that rests earlier is not simulated further.
    follow : the motion that an arm is told → the one it makes (`Following.motion`).
    reach_m : (2,), where the free end lies from the tool before the cast, `mean_reach` of casts
        that were measured; None starts the cable along the tool's yaw.
    """
    endpoints_m = np.empty((len(actions), 2))
    diverged = np.empty(len(actions), dtype=bool)
    for first in range(0, len(actions), ACTIONS_AT_ONCE):
        part = slice(first, first + ACTIONS_AT_ONCE)
        casts = []
        for action, planned in zip(actions[part], plan(actions[part]), strict=True):
            tool, last_s = follow(planned.tool), np.array([planned.end_s + settle_s])
            start_m = None if reach_m is None else tool.pose[0, :2] + reach_m
            casts.append(SimulatedCast(tool, last_s, start_m, action_factors(action)))
        prediction = simulator.simulate(
            casts, vector, progress=_part_of(progress, first, len(actions))
        )
        endpoints_m[part] = prediction.waypoints_m[0, :, 0]
        diverged[part] = prediction.diverged[0]
    return Generated(actions, endpoints_m, diverged)


def mean_reach(casts: Iterable[Cast]) -> np.ndarray | None:
    """Return where the free end lies from the tool, (2,), on average, before measured casts.

    Resets lay a cable a little to one side; None where no cast shows it.
    """
    seen = [cast.start_m - cast.tool.pose[0, :2] for cast in casts if cast.start_m is not None]
    return np.mean(seen, axis=0) if seen else None


def _part_of(progress: Progress, first: int, whole: int) -> Progress:
    def report(done: int, total: int, note: str = "") -> None:
        progress(first + done, whole, note)

    return report
