"""Nothing is told to the arm that breaks a limit, holds no number or starts elsewhere."""

from dataclasses import replace

import numpy as np
import pytest

from robotcast.casts.action import Action
from robotcast.casts.plan import PlanLimits, plan_action
from robotcast.rigs.kinematics import GRIPPER, joints_pointing_down
from robotcast.rigs.ur5.motion import (
    JointMotion,
    WholeMotion,
    held_pose,
    plan_whole,
    refuse_motion,
    refuse_unsafe,
)
from tests.rigs.peer.lab import HOME_RAD, LIMITS, QUICK_RESET
from tests.rigs.small_rig import CABLE, R0_M, SHORT_CAST

HOME = np.array(HOME_RAD)


def whole(live: np.ndarray = HOME) -> WholeMotion:
    length = CABLE.length_m + 0.015
    return plan_whole(SHORT_CAST, live, length, r0_m=R0_M, settings=QUICK_RESET, gripper=GRIPPER)


def changed(motion: JointMotion, row: int, joint: int, value: float) -> JointMotion:
    joints = motion.joints_rad.copy()
    joints[row, joint] = value
    return JointMotion(motion.t_s, joints)


def test_an_ordinary_motion_passes_and_is_continuous():
    motion = whole()
    refuse_unsafe(motion, HOME, LIMITS)
    assert np.allclose(motion.reset.joints_rad[-1], motion.cast.joints_rad[0], atol=1e-3)


def test_a_reset_starts_where_a_cast_ended():
    end = joints_pointing_down(SHORT_CAST.tool.pose[-1])
    motion = whole(end)
    refuse_unsafe(motion, end, LIMITS)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_number_that_is_none_is_refused(value: float):
    motion = whole()
    bad = WholeMotion(motion.reset, changed(motion.cast, 40, 2, value))
    with pytest.raises(ValueError, match="not finite"):
        refuse_unsafe(bad, HOME, LIMITS)


def test_a_jump_is_refused():
    motion = whole()
    bad = WholeMotion(
        motion.reset, changed(motion.cast, 40, 0, motion.cast.joints_rad[40, 0] + 0.1)
    )
    with pytest.raises(ValueError, match=r"nothing moved: joint speed|nothing moved: joint acc"):
        refuse_unsafe(bad, HOME, LIMITS)


def test_a_shake_too_small_for_the_acceleration_limit_breaks_the_jerk_limit():
    motion = whole().cast
    joints = motion.joints_rad.copy()
    joints[40, 3] += 5e-4
    limits = replace(LIMITS, cast=replace(LIMITS.cast, joint_acceleration_rad_s2=(1e4,) * 6))
    with pytest.raises(ValueError, match=r"joint jerk \(wrist 1\)"):
        refuse_motion(JointMotion(motion.t_s, joints), limits.cast, limits, "cast")


@pytest.mark.parametrize("joint", range(6))
def test_an_arm_that_stands_elsewhere_is_refused(joint: int):
    live = HOME.copy()
    live[joint] += 0.1
    with pytest.raises(ValueError, match=r"from where the motion starts|nothing moved"):
        refuse_unsafe(whole(), live, LIMITS)


def test_an_arm_of_unknown_place_is_refused():
    with pytest.raises(ValueError, match="nothing moved"):
        refuse_unsafe(whole(), np.full(6, np.nan), LIMITS)


def test_a_lifted_or_tilted_tool_is_no_start():
    lifted, tilted = HOME.copy(), HOME.copy()
    lifted[1] -= 0.1
    tilted[4] += 0.05
    for joints in (lifted, tilted):
        with pytest.raises(ValueError, match="a reset starts from a tool that points down"):
            held_pose(joints, GRIPPER)
    with pytest.raises(ValueError, match="six finite"):
        held_pose(np.full(6, np.inf), GRIPPER)


def test_the_reset_turns_the_wrist_back_however_far_a_cast_turned_it():
    planned = plan_action(Action(0.6, 0.65, -0.6, 0.7, 2.0, 1.5), r0_m=R0_M, limits=PlanLimits())
    end = joints_pointing_down(planned.tool.pose[-1] + np.array([0.0, 0.0, 2.5]))
    motion = whole(end)
    assert motion.reset.joints_rad[-1] == pytest.approx(HOME, abs=1e-3)


def test_a_slow_run_takes_the_same_path():
    motion = whole().cast
    slow = motion.at_speed(0.1, 0.008)
    assert slow.t_s[-1] == pytest.approx(10 * motion.t_s[-1], abs=0.01)
    assert np.allclose(slow.joints_rad[-1], motion.joints_rad[-1])
    assert motion.at_speed(1.0, 0.008) is motion
    fine = motion.at_speed(1.0, 0.002)
    assert np.abs(fine.joints_rad[::4][: len(motion.t_s)] - motion.joints_rad).max() < 1e-9
