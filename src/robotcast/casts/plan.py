"""From the numbers of a cast to the motion of the tool."""

from dataclasses import dataclass

import numpy as np

from robotcast.casts.action import ACTION_COLUMNS, Action
from robotcast.casts.curves import CastCurves, plan_curves
from robotcast.casts.limits import PlanLimits
from robotcast.casts.tool_motion import ToolMotion

__all__ = ["PlanLimits", "PlannedCast", "plan_action", "plan_actions", "plan_cast"]


@dataclass(frozen=True)
class PlannedCast:
    """A cast as it is told to an arm.

    Attributes
    ----------
    action : with r₁ filled in.
    tool : sampled at the planning period from the start until the tool rests.
    turn_s, end_s : when the tool rests in θ₁ and when it arrives in θ₂.
    """

    action: Action
    tool: ToolMotion
    turn_s: float
    end_s: float


def plan_cast(
    theta1_rad: float,
    theta2_rad: float,
    r2_m: float,
    alpha_rad: float,
    vmax_m_s: float,
    *,
    r0_m: float,
    r1_m: float | None = None,
    limits: PlanLimits,
) -> PlannedCast:
    """Plan the cast with these numbers.

    The radius is a cubic spline from r₀ to r₂ with zero slope at both ends; with `r1_m` it
    passes through r₁ at θ₁. The angle goes from 0 to θ₁ and on to θ₂ as fast as v_max, the
    angular acceleration and the jerk allow, at rest in θ₁. α is blended into the yaw over
    the second arc by a quintic.
    """
    r1 = np.nan if r1_m is None else r1_m
    action = np.array([[theta1_rad, r1, theta2_rad, r2_m, alpha_rad, vmax_m_s]], dtype=float)
    check_actions(action, r0_m, limits, r1_given=r1_m is not None)
    return _planned(plan_curves(action, r0_m, limits), limits)[0]


def plan_action(action: Action, *, r0_m: float, limits: PlanLimits) -> PlannedCast:
    """Plan the cast of `action`, through its own r₁."""
    return plan_actions(action.as_array()[None], r0_m=r0_m, limits=limits)[0]


def plan_actions(actions: np.ndarray, *, r0_m: float, limits: PlanLimits) -> list[PlannedCast]:
    """Plan the casts of `actions` (n, 6), columns `ACTION_COLUMNS`, each through its r₁."""
    actions = np.asarray(actions, dtype=float)
    check_actions(actions, r0_m, limits)
    return _planned(plan_curves(actions, r0_m, limits), limits)


def _planned(curves: CastCurves, limits: PlanLimits) -> list[PlannedCast]:
    turn, end = curves.turn_s, curves.end_s
    counts = np.ceil(end / limits.period_s - 1e-9).astype(int) + 1
    planned = []
    for start in range(0, len(counts), 1024):
        chunk = slice(start, start + 1024)
        t_s = np.arange(counts[chunk].max()) * limits.period_s
        poses = curves.rows(chunk).poses_at(t_s)
        for row, pose in enumerate(poses, start):
            motion = ToolMotion(t_s[: counts[row]].copy(), pose[: counts[row]].copy())
            action = Action.from_array(curves.actions[row])
            planned.append(PlannedCast(action, motion, float(turn[row]), float(end[row])))
    return planned


def check_actions(
    actions: np.ndarray, r0_m: float, limits: PlanLimits, *, r1_given: bool = True
) -> None:
    """Refuse actions (n, 6) that cannot be planned, naming the first, its value and the limit.

    Parameters
    ----------
    r1_given : False when r₁ is still to be filled in.
    """
    _check_radius("r0", np.array([r0_m]), limits)
    checked = [0, 1, 2, 3, 4, 5] if r1_given else [0, 2, 3, 4, 5]
    for column in checked:
        bad = ~np.isfinite(actions[:, column])
        if bad.any():
            value = actions[bad, column][0]
            raise ValueError(f"cast: {ACTION_COLUMNS[column]} must be finite, got {value}")
    theta1, r1, theta2, r2, alpha, vmax = actions.T
    for name, values, limit in (
        ("theta1", theta1, limits.angle_rad),
        ("theta2", theta2, limits.angle_rad),
        ("alpha", alpha, limits.alpha_rad),
    ):
        bad = np.abs(values) > limit
        if bad.any():
            raise ValueError(
                f"cast: |{name}| must not exceed {limit:g} rad, got {values[bad][0]:g}"
            )
    bad = (vmax <= 0) | (vmax > limits.vmax_m_s)
    if bad.any():
        raise ValueError(
            f"cast: vmax must be in (0, {limits.vmax_m_s:g}] m/s at the tool, got {vmax[bad][0]:g}"
        )
    bad = theta1 * (theta1 - theta2) <= 0
    if bad.any():
        raise ValueError(
            "cast: the second arc must turn back from theta1, "
            f"got theta1 {theta1[bad][0]:g} and theta2 {theta2[bad][0]:g} rad"
        )
    _check_radius("r2", r2, limits)
    if r1_given:
        _check_radius("r1", r1, limits)


def _check_radius(name: str, values: np.ndarray, limits: PlanLimits) -> None:
    bad = ~((values >= limits.r_min_m) & (values <= limits.r_max_m))
    if bad.any():
        raise ValueError(
            f"cast: {name} must be in [{limits.r_min_m:g}, {limits.r_max_m:g}] m, "
            f"got {values[bad][0]:g}"
        )
