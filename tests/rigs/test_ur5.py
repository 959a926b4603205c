import numpy as np
import pytest
from ur_analytic_ik import ur5  # pyright: ignore[reportAttributeAccessIssue]

from robotcast.casts.plan import PlanLimits, plan_cast
from robotcast.casts.tool_motion import ToolMotion
from robotcast.rigs.kinematics import (
    LINKS,
    Gripper,
    joint_path,
    joints_pointing_down,
    link_points,
    tilted_joint_path,
)

GRIPPER = Gripper(length_m=0.17, fingers_m=0.06, held_height_m=0.02)


def random_poses(n: int = 300) -> np.ndarray:
    rng = np.random.default_rng(1)
    radius, angle = rng.uniform(0.5, 0.88, n), rng.uniform(-1.5, 1.5, n)
    yaw = rng.uniform(-3, 3, n)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), yaw], axis=1)


def flange(pose: np.ndarray) -> np.ndarray:
    x, y, yaw = pose
    c, s = np.cos(yaw), np.sin(yaw)
    matrix = np.eye(4)
    matrix[:3, :3] = [[c, s, 0], [s, -c, 0], [0, 0, -1]]
    matrix[:3, 3] = [x, y, GRIPPER.held_height_m + GRIPPER.length_m]
    return matrix


def test_the_closed_form_is_one_of_the_librarys_solutions():
    for pose in random_poses():
        joints = joints_pointing_down(pose, GRIPPER)
        solutions = np.array(ur5.inverse_kinematics(flange(pose)))
        apart = np.abs((solutions - joints + np.pi) % (2 * np.pi) - np.pi).max(axis=1)
        assert apart.min() < 1e-9


def test_the_librarys_forward_kinematics_gives_the_pose_back():
    for pose in random_poses():
        back = ur5.forward_kinematics(*joints_pointing_down(pose, GRIPPER))
        np.testing.assert_allclose(back, flange(pose), atol=1e-9)


def test_link_points_end_at_the_held_end_with_the_fingers_pointing_down():
    poses = random_poses()
    points = link_points(joints_pointing_down(poses, GRIPPER), GRIPPER)
    np.testing.assert_allclose(points[:, -1, :2], poses[:, :2], atol=1e-12)
    np.testing.assert_allclose(points[:, -1, 2], GRIPPER.held_height_m, atol=1e-12)
    np.testing.assert_allclose(points[:, -1] - points[:, -2], [[0, 0, -0.06]] * 300, atol=1e-12)


def test_link_points_agree_with_the_library_in_any_posture():
    rng = np.random.default_rng(2)
    for joints in rng.uniform(-np.pi, np.pi, (100, 6)):
        points = link_points(joints, GRIPPER)
        pose = ur5.forward_kinematics(*joints)
        np.testing.assert_allclose(points[-3], pose[:3, 3], atol=1e-9)
        np.testing.assert_allclose(points[-1], pose[:3, 3] + 0.17 * pose[:3, 2], atol=1e-9)
    assert points.shape == (len(LINKS) + 1, 3)


def test_the_elbow_stays_above_the_wrist_and_the_path_is_continuous():
    cast = plan_cast(1.1, -1.2, 0.85, 1.2, 2.0, r0_m=0.6, limits=PlanLimits())
    joints = joint_path(cast.tool, GRIPPER)
    assert np.abs(np.diff(joints, axis=0)).max() < 0.1
    points = link_points(joints, GRIPPER)
    assert np.all(points[:, 3, 2] > points[:, 5, 2])


def test_a_path_around_the_back_of_the_base_is_unwrapped():
    angle = np.linspace(0, 2 * np.pi, 200)
    pose = np.stack([0.6 * np.cos(angle), 0.6 * np.sin(angle), angle], axis=1)
    joints = joint_path(ToolMotion(angle, pose), GRIPPER)
    assert np.abs(np.diff(joints, axis=0)).max() < 0.1
    np.testing.assert_allclose(joints[-1, 0] - joints[0, 0], 2 * np.pi)
    np.testing.assert_allclose(np.ptp(joints[:, 5]), 0.0, atol=1e-9)


def test_out_of_reach_is_refused_with_place_and_time():
    pose = np.array([[0.6, 0, 0], [1.2, 0, 0]])
    with pytest.raises(ValueError, match=r"cannot hold \(1.200, 0.000\) m .* t = 0.008 s"):
        joint_path(ToolMotion(np.array([0, 0.008]), pose), GRIPPER)
    assert np.isnan(joints_pointing_down(pose, GRIPPER)[1]).any()
    with pytest.raises(ValueError, match="not finite"):
        joint_path(ToolMotion(np.array([0.0]), np.array([[np.nan, 0, 0]])), GRIPPER)


def test_a_tilting_tool_starts_on_the_casts_branch_and_keeps_its_end_in_place():
    n = 50
    position = np.tile([0.6, 0.0, 0.3], (n, 1))
    position[:, 2] = np.linspace(GRIPPER.held_height_m, 0.3, n)
    pitch = np.linspace(0, 1.2, n)
    joints = tilted_joint_path(position, pitch, np.zeros(n), GRIPPER)
    down = joints_pointing_down(np.array([0.6, 0.0, 0.0]), GRIPPER)
    np.testing.assert_allclose(joints[0], down, atol=1e-9)
    points = link_points(joints, GRIPPER)
    np.testing.assert_allclose(points[:, -1], position, atol=1e-9)
    axis = (points[:, -1] - points[:, -2]) / GRIPPER.fingers_m
    expected = np.stack([np.sin(pitch), 0 * pitch, -np.cos(pitch)], axis=1)
    np.testing.assert_allclose(axis, expected, atol=1e-9)
    assert np.abs(np.diff(joints, axis=0)).max() < 0.2


def test_an_impossible_gripper_is_refused():
    with pytest.raises(ValueError, match="fingers_m < length_m"):
        Gripper(length_m=0.05, fingers_m=0.06, held_height_m=0.02)
    with pytest.raises(ValueError, match="held_height_m"):
        Gripper(length_m=0.17, fingers_m=0.06, held_height_m=20.0)
