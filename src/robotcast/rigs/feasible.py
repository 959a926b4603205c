"""Which actions the arm can do."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from robotcast.casts.curves import CastCurves, distinct_arcs, plan_curves
from robotcast.casts.grid import ActionGrid
from robotcast.casts.limits import PlanLimits
from robotcast.progress import Progress, silent
from robotcast.rigs.envelope import (
    Envelope,
    Rule,
    broken_collision_rules,
    broken_joint_rules,
    broken_tool_rules,
)
from robotcast.rigs.ur5 import joints_pointing_down

JOINT_SAMPLE_S = 0.004
PLACE_SAMPLE_S = 0.008
ROWS_AT_ONCE = 256
UNMIRRORED = np.ones(3)
MIRRORED = np.array([1.0, -1.0, -1.0])


@dataclass(frozen=True)
class FilterReport:
    """What became of a grid.

    Attributes
    ----------
    candidates, feasible : how many actions the grid holds, and how many the arm can do.
    broken : how many candidates break each rule; one may break several.
    """

    candidates: int
    feasible: int
    broken: dict[Rule, int]


def feasible_actions(
    grid: ActionGrid,
    r0_m: float,
    limits: PlanLimits,
    envelope: Envelope,
    progress: Progress = silent,
) -> tuple[np.ndarray, FilterReport]:
    """Return the actions of the grid that the arm can do, (m, 6), and why others fell.

    An action stays when the arm can do it and its mirror image: the arm itself is not
    symmetric, and a policy uses both.
    """
    curves = grid.curves(r0_m, limits)
    broken = _broken_rules(curves, envelope, progress)
    kept = ~np.any(list(broken.values()), axis=0)
    counts: dict[Rule, int] = {rule: int(bad.sum()) for rule, bad in broken.items()}
    return curves.actions[kept], FilterReport(len(kept), int(kept.sum()), counts)


def are_feasible(
    actions: np.ndarray, r0_m: float, limits: PlanLimits, envelope: Envelope
) -> np.ndarray:
    """Tell which of `actions` (n, 6) the arm can do, mirrored or not, (n,) of bool."""
    broken = _broken_rules(plan_curves(actions, r0_m, limits), envelope, silent)
    return ~np.any(list(broken.values()), axis=0)


def _broken_rules(
    curves: CastCurves, envelope: Envelope, progress: Progress
) -> dict[Rule, np.ndarray]:
    """Return which casts break which rule, mirrored or not, each (n,) of bool."""
    first, member = distinct_arcs(curves.actions)
    arcs = curves.rows(first)
    tool = _broken_by(broken_tool_rules, arcs, PLACE_SAMPLE_S, envelope)
    collisions = _broken_by(
        broken_collision_rules, arcs, PLACE_SAMPLE_S, envelope, images=(UNMIRRORED,)
    )
    broken: dict[Rule, np.ndarray] = {
        rule: bad[member] for rule, bad in (tool | collisions).items()
    }
    broken |= _broken_by(broken_joint_rules, curves, JOINT_SAMPLE_S, envelope, progress=progress)
    return broken


def _broken_by(
    rules: Callable[[np.ndarray, np.ndarray, Envelope], dict[Rule, np.ndarray]],
    curves: CastCurves,
    sample_s: float,
    envelope: Envelope,
    *,
    images: tuple[np.ndarray, ...] = (UNMIRRORED, MIRRORED),
    progress: Progress = silent,
) -> dict[Rule, np.ndarray]:
    """Return which casts break which rule in any of their `images`, each (n,) of bool."""
    n = len(curves.actions)
    broken: dict[Rule, np.ndarray] = {}
    done = 0
    for rows, t_s, pose in _sampled(curves, sample_s):
        for image in images:
            joints = joints_pointing_down(pose * image, envelope.gripper)
            for rule, outside in rules(t_s, joints, envelope).items():
                broken.setdefault(rule, np.zeros(n, dtype=bool))[rows] |= outside
        done += len(rows)
        progress(done, n, "filtering")
    return broken


def _sampled(
    curves: CastCurves, sample_s: float
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield rows of casts of like duration, their times (m,) and their poses (k, m, 3)."""
    order = np.argsort(curves.end_s, kind="stable")
    for start in range(0, len(order), ROWS_AT_ONCE):
        rows = order[start : start + ROWS_AT_ONCE]
        some = curves.rows(rows)
        t_s = np.arange(0.0, some.end_s.max() + 2 * sample_s, sample_s)
        yield rows, t_s, some.poses_at(t_s)
