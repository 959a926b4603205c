"""An arm's following is learned from its logs, whatever linear thing the arm is."""

import numpy as np
import pytest
from scipy.signal import lti

from robotcast.casts.action import ToolMotion
from robotcast.casts.plan import PlanLimits, exact_following, fit_following
from tests.good_casts import plan_cast

PERIOD_S = 0.008
ARCS = [(0.4, -0.3, 0.7, 0.6, 1.5), (0.7, -0.5, 0.6, 1.2, 2.0), (0.9, -0.8, 0.75, 0.0, 1.2)]
ARCS += [(0.6, -0.6, 0.65, 0.9, 1.8)]  # the last is not fitted to
*MOTIONS, FURTHER = (plan_cast(*arcs, r0_m=0.6, limits=PlanLimits()).tool for arcs in ARCS)


def passed_through(system: lti, motion: ToolMotion, delay_s: float) -> ToolMotion:
    """Return the answer of a linear arm, simulated finely, at the times of a log."""
    fine_s = np.arange(0, motion.t_s[-1] + 0.3, 0.0005)
    asked = motion.at(fine_s - delay_s) - motion.pose[0]
    answered = np.stack([system.output(column, fine_s)[1] for column in asked.T], axis=1)
    made = ToolMotion(fine_s, motion.pose[0] + answered)
    t_s = np.arange(0, fine_s[-1], PERIOD_S)
    return ToolMotion(t_s, made.at(t_s))


@pytest.mark.parametrize(
    ("system", "delay_s", "lag_s"),
    [
        (lti([1], [0.03, 1]), 0.0, 0.03),
        (lti([0.98], [1 / 60**2, 2 * 0.7 / 60, 1]), 0.012, 0.012 + 1.4 / 60),
    ],
    ids=["first order", "second order, late, short"],
)
def test_an_arm_is_followed_in_a_cast_that_it_never_made(system, delay_s, lag_s):
    made = [passed_through(system, m, delay_s) for m in MOTIONS]
    following = fit_following(list(zip(MOTIONS, made, strict=True)), PERIOD_S)
    assert following.believed
    assert following.lag_s == pytest.approx(lag_s, abs=0.001)
    assert following.followed_rms_m < 0.02 * following.told_rms_m
    truth, ours = passed_through(system, FURTHER, delay_s), following.motion(FURTHER)
    away = np.abs(ours.at(truth.t_s) - truth.pose).max(axis=0)
    assert (away < [0.001, 0.001, 0.005]).all()
    assert np.allclose(ours.pose[0], FURTHER.pose[0])
    assert np.allclose(ours.pose[-1], ours.pose[-2], atol=1e-4)  # it came to rest


def test_an_arm_that_does_as_told_and_stands_elsewhere_changes_nothing():
    moved = [ToolMotion(m.t_s, m.pose + np.array([0.002, -0.001, 0.01])) for m in MOTIONS]
    following = fit_following(list(zip(MOTIONS, moved, strict=True)), PERIOD_S)
    assert following.lag_s == pytest.approx(0.0, abs=2e-4)
    assert np.allclose(following.motion(FURTHER).at(FURTHER.t_s), FURTHER.pose, atol=5e-4)


def test_motions_of_other_plans_are_not_believed():
    other = [ToolMotion(2 * m.t_s, m.pose) for m in MOTIONS]
    assert not fit_following(list(zip(MOTIONS, other, strict=True)), PERIOD_S).believed
    exact = exact_following(PERIOD_S)
    assert exact.motion(MOTIONS[0]).pose == pytest.approx(MOTIONS[0].pose)
