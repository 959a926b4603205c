"""Casts as they are measured when nothing is wrong: the rules of a set let them pass."""

from collections.abc import Sequence

import numpy as np

from robotcast.casts.action import Action, ToolMotion
from robotcast.casts.curves import PlanLimits, plan_curves
from robotcast.casts.plan import PlannedCast, check_actions, plan_action
from robotcast.measurements.measurement_set import Cable, MeasurementSet, Trial

CABLE = Cable("cable1", 0.63, 0.008, 0.0045, 0.02)
NOISE_M = 0.002
ACTIONS = (Action(0.7, 0.62, -0.6, 0.65, 0.5, 1.25), Action(0.5, 0.62, -0.8, 0.7, 0.4, 1.5))


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
    """Plan a cast whose r₁ is where the spline without it passes, as in a grid."""
    ends = np.array([[theta1_rad, np.nan, theta2_rad, r2_m, alpha_rad, vmax_m_s]])
    if r1_m is None:
        check_actions(ends, r0_m, limits)
        r1_m = float(plan_curves(ends, r0_m, limits).actions[0, 1])
    action = Action(theta1_rad, r1_m, theta2_rad, r2_m, alpha_rad, vmax_m_s)
    return plan_action(action, r0_m=r0_m, limits=limits)


def mirrored_tool(tool: ToolMotion) -> ToolMotion:
    """The motion mirrored about the board's axis of symmetry (y → −y)."""
    return ToolMotion(tool.t_s, tool.pose * np.array([1.0, -1.0, -1.0]))


def good_trial(
    number: int, action_id: int, action: Action, cable: Cable = CABLE, noise_m: float = NOISE_M
) -> Trial:
    """A cast whose free end trails the tool on a taut cable until both rest."""
    tool = plan_action(action, r0_m=0.6, limits=PlanLimits()).tool
    t_s = np.round(np.arange(0, tool.t_s[-1] + 1.0, 0.1), 6)
    behind, held = (tool.at(t_s - late_s)[:, :2] for late_s in (0.15, 0.0))
    end = held + 0.98 * cable.length_m * behind / np.linalg.norm(behind, axis=1, keepdims=True)
    end += noise_m * np.random.default_rng(number).standard_normal(end.shape)
    return Trial(number, action_id, action, tool, t_s, np.round(end, 6))


def good_set(
    actions: Sequence[Action] = (*ACTIONS, ACTIONS[0]), cable: Cable = CABLE, rig: str = "recorded"
) -> MeasurementSet:
    """Casts of these actions; those that stand there twice are repeats."""
    ids = [list(actions).index(action) for action in actions]
    trials = (good_trial(n, i, a, cable) for n, (i, a) in enumerate(zip(ids, actions, strict=True)))
    return MeasurementSet(cable, 0.6, 0.1, NOISE_M, tuple(trials), rig)
