"""Pulling the cable straight in after a reset along any ray (paper, "Baseline Policies")."""

import math

import numpy as np

from robotcast.casts.action import Action
from robotcast.casts.curves import smooth_step
from robotcast.casts.limits import PlanLimits
from robotcast.casts.plan import PlannedCast
from robotcast.casts.tool_motion import ToolMotion

_PEAK = 1.875  # largest slope of the quintic from 0 to 1
_SHORTEST_S = 0.5


def pull_action(angle_rad: float, from_m: float, to_m: float, speed_m_s: float) -> Action:
    """Return a pull along one ray as an action: θ₁ = θ₂, from r₁ to r₂, at v_max at most."""
    return Action(angle_rad, from_m, angle_rad, to_m, 0.0, speed_m_s)


def plan_pull(action: Action, *, r0_m: float, limits: PlanLimits) -> PlannedCast:
    """Plan the tool motion of a pull: it lies in wait at r₁ and moves to r₂, at rest at both ends.

    Parameters
    ----------
    r0_m : of the rig's casts; a pull starts where its own reset set the held end down.
    """
    if action.theta1_rad != action.theta2_rad or action.alpha_rad != 0:
        raise ValueError("pull: the held end stays on one ray, got theta1 ≠ theta2 or alpha ≠ 0")
    start, end = action.r1_m, action.r2_m
    if not limits.r_min_m <= end <= start <= limits.r_max_m:
        raise ValueError(
            f"pull: expected {limits.r_min_m:g} ≤ r2 ≤ r1 ≤ {limits.r_max_m:g} m, "
            f"got r1 {start:g} and r2 {end:g}"
        )
    if abs(action.theta1_rad) > limits.angle_rad or action.vmax_m_s <= 0:
        raise ValueError(
            f"pull: |theta| must not exceed {limits.angle_rad:g} rad and vmax must be positive, "
            f"got {action.theta1_rad:g} and {action.vmax_m_s:g}"
        )
    end_s = max(_SHORTEST_S, _PEAK * (start - end) / action.vmax_m_s)
    t_s = np.arange(math.ceil(end_s / limits.period_s - 1e-9) + 1) * limits.period_s
    radius = start + (end - start) * smooth_step(t_s / end_s)
    angle = np.full(len(t_s), action.theta1_rad)
    pose = np.stack([radius * np.cos(angle), radius * np.sin(angle), angle], axis=1)
    return PlannedCast(action, ToolMotion(t_s, pose), 0.0, end_s)
