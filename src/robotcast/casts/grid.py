"""Grids of actions, and which of them the arm can do."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields

import numpy as np

from robotcast.casts.curves import CastCurves, distinct_arcs, plan_curves
from robotcast.casts.limits import PlanLimits
from robotcast.casts.plan import check_actions
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
class GridCounts:
    """How many values each coordinate of a grid takes."""

    theta1: int
    theta2: int
    r2: int
    alpha: int
    vmax: int

    def __post_init__(self) -> None:
        for field in fields(self):
            if getattr(self, field.name) < 1:
                raise ValueError(
                    f"grid: the count of {field.name} must be at least 1, "
                    f"got {getattr(self, field.name)}"
                )


@dataclass(frozen=True)
class ActionGrid:
    """Evenly spaced values of θ₁, θ₂, r₂, α and v_max, each [first, last].

    Only the half θ₁ > 0, θ₂ < 0, α ≥ 0 is sampled; mirror images are the other half (paper,
    "Parameterized Actions").
    """

    theta1_rad: tuple[float, float]
    theta2_rad: tuple[float, float]
    r2_m: tuple[float, float]
    alpha_rad: tuple[float, float]
    vmax_m_s: tuple[float, float]
    counts: GridCounts

    def __post_init__(self) -> None:
        for name, kept, rule in (
            ("theta1_rad", min(self.theta1_rad) > 0, "positive"),
            ("theta2_rad", max(self.theta2_rad) < 0, "negative"),
            ("alpha_rad", min(self.alpha_rad) >= 0, "zero or positive"),
        ):
            if not kept:
                raise ValueError(f"grid: {name} must be {rule}, got {list(getattr(self, name))}")

    def axes(self) -> list[tuple[float, float, int]]:
        """Return first, last and count of θ₁, θ₂, r₂, α and v_max."""
        ends = (self.theta1_rad, self.theta2_rad, self.r2_m, self.alpha_rad, self.vmax_m_s)
        return [
            (first, last, getattr(self.counts, field.name))
            for (first, last), field in zip(ends, fields(self.counts), strict=True)
        ]

    def candidates(self, r0_m: float, limits: PlanLimits) -> np.ndarray:
        """Return every action of the grid with its r₁, (n, 6), the last coordinate fastest."""
        return self._curves(r0_m, limits).actions

    def _curves(self, r0_m: float, limits: PlanLimits) -> CastCurves:
        axes = [np.linspace(*axis) for axis in self.axes()]
        axes.insert(1, np.array([np.nan]))
        actions = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 6)
        check_actions(actions, r0_m, limits, r1_given=False)
        return plan_curves(actions, r0_m, limits)


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
    curves = grid._curves(r0_m, limits)
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
