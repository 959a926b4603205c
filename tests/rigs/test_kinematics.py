"""The kinematics is the library's, and the capsules hold the arm's housings.

Frames and sizes of the housings are those of ROS-Industrial's `ur_description` (commit a7a2c54):
every joint turns about its z.
"""

from dataclasses import dataclass

import numpy as np
import pytest
from ur_analytic_ik import ur5  # pyright: ignore[reportAttributeAccessIssue]

from robotcast.casts.action import ToolMotion
from robotcast.casts.plan import PlanLimits
from robotcast.rigs.kinematics import (
    LINK_CAPSULES,
    Gripper,
    capsule_axes,
    joint_path,
    joints_pointing_down,
    link_points,
    segment_distance,
    tilted_joint_path,
)
from tests.good_casts import plan_cast

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


def test_the_librarys_forward_kinematics_gives_the_pose_back():
    for pose in random_poses():
        joints = joints_pointing_down(pose, GRIPPER)
        np.testing.assert_allclose(ur5.forward_kinematics(*joints), flange(pose), atol=1e-9)
        held_m = [*pose[:2], GRIPPER.held_height_m]
        np.testing.assert_allclose(link_points(joints, GRIPPER)[-1], held_m, atol=1e-9)


def test_link_points_agree_with_the_library_in_any_posture():
    rng = np.random.default_rng(2)
    for joints in rng.uniform(-np.pi, np.pi, (100, 6)):
        points = link_points(joints, GRIPPER)
        pose = ur5.forward_kinematics(*joints)
        np.testing.assert_allclose(points[-3], pose[:3, 3], atol=1e-9)
        np.testing.assert_allclose(points[-1], pose[:3, 3] + 0.17 * pose[:3, 2], atol=1e-9)
    assert points.shape == (len(LINK_CAPSULES) + 1, 3)


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


QUARTER = np.pi / 2
JOINTS = (  # x, y, z [m], roll [rad] of every joint in the frame of the one before
    (0.0, 0.0, 0.089159, 0.0),
    (0.0, 0.0, 0.0, QUARTER),
    (-0.425, 0.0, 0.0, 0.0),
    (-0.39225, 0.0, 0.10915, 0.0),
    (0.0, -0.09465, 0.0, QUARTER),
    (0.0, 0.0823, 0.0, -QUARTER),
)


@dataclass(frozen=True)
class Cylinder:
    """A housing: its axis from one place to another in the frame of a joint, all in m."""

    joint: int
    start: tuple[float, float, float]
    end: tuple[float, float, float]
    radius: float


HOUSINGS = {
    "base": Cylinder(0, (0, 0, -0.065), (0, 0, 0.0685), 0.0594),
    "shoulder": Cylinder(1, (0, 0, 0.0707), (0, 0, 0.2044), 0.0597),
    "upper arm": Cylinder(1, (-0.08, 0, 0.1359), (-0.35, 0, 0.1359), 0.0574),
    "elbow of the upper arm": Cylinder(1, (-0.425, 0, 0.0707), (-0.425, 0, 0.2044), 0.0599),
    "elbow of the forearm": Cylinder(2, (0, 0, -0.0232), (0, 0, 0.071), 0.0580),
    "forearm": Cylinder(2, (-0.07, 0, 0.0165), (-0.3, 0, 0.0165), 0.0394),
    "wrist of the forearm": Cylinder(2, (-0.3922, 0, -0.0407), (-0.3922, 0, 0.064), 0.0389),
    "wrist 1": Cylinder(3, (0, 0, -0.0455), (0, 0, 0.0395), 0.0389),
    "wrist 1 towards 2": Cylinder(3, (0, 0.0572, 0), (0, -0.0475, 0), 0.0389),
    "wrist 2": Cylinder(4, (0, 0, -0.0459), (0, 0, 0.0384), 0.0389),
    "wrist 2 towards 3": Cylinder(4, (0, -0.0572, 0), (0, 0.0475, 0), 0.0389),
    "wrist 3": Cylinder(5, (0, 0, -0.0345), (0, 0, 0), 0.0375),
}


def joint_frames(joints_rad: np.ndarray) -> list[np.ndarray]:
    """Return the frames (4, 4) of the six joints."""
    frame, frames = np.eye(4), []
    for (x, y, z, roll), angle in zip(JOINTS, joints_rad, strict=True):
        c, s, ca, sa = np.cos(roll), np.sin(roll), np.cos(angle), np.sin(angle)
        moved = [[1, 0, 0, x], [0, c, -s, y], [0, s, c, z], [0, 0, 0, 1]]
        turned = [[ca, -sa, 0, 0], [sa, ca, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
        frame = frame @ np.array(moved) @ np.array(turned)
        frames.append(frame)
    return frames


def rims(housing: Cylinder, frame: np.ndarray) -> np.ndarray:
    """Return points (n, 3) on both rims of a housing."""
    start, end = np.array(housing.start), np.array(housing.end)
    along = (end - start) / np.linalg.norm(end - start)
    across = np.roll(along, 1)
    turns = np.linspace(0, 2 * np.pi, 24, endpoint=False)[:, None]
    ring = np.cos(turns) * across + np.sin(turns) * np.cross(along, across)
    points = np.concatenate([start + housing.radius * ring, end + housing.radius * ring])
    return points @ frame[:3, :3].T + frame[:3, 3]


def outside_m(points_m: np.ndarray, arm_m: np.ndarray) -> float:
    """Return how far the outermost of some points lies outside all capsules."""
    depth = []
    for link, (start, end) in capsule_axes(arm_m).items():
        away = segment_distance(points_m, points_m, start[None], end[None])
        depth.append(away - LINK_CAPSULES[link].radius_m)
    return float(np.min(depth, axis=0).max())


def test_the_frames_are_those_of_the_arm():
    joints = np.random.default_rng(0).uniform(-np.pi, np.pi, 6)
    np.testing.assert_allclose(joint_frames(joints)[5][:3, 3], link_points(joints)[8], atol=1e-9)


@pytest.mark.parametrize("name", HOUSINGS)
def test_the_capsules_hold_every_housing_in_any_posture(name):
    housing, random = HOUSINGS[name], np.random.default_rng(1)
    for joints in random.uniform(-np.pi, np.pi, (8, 6)):
        points = rims(housing, joint_frames(joints)[housing.joint])
        assert outside_m(points, link_points(joints)) <= 0


def test_a_capsule_reaches_no_further_than_a_hand_breadth_beyond_its_link():
    for capsule in LINK_CAPSULES.values():
        assert capsule.radius_m + max(capsule.before_m, capsule.beyond_m) < 0.11


def test_the_distance_of_two_segments():
    a = np.array([[0, 0, 0], [1.0, 0, 0]])
    crossing = np.array([[0.5, -1, 0.2], [0.5, 1, 0.2]])
    beyond = np.array([[2.0, 0, 0], [3.0, 0, 0]])
    parallel = np.array([[0.2, 0.3, 0], [0.8, 0.3, 0]])
    point = np.array([[0.0, 0, 0.4], [0.0, 0, 0.4]])
    for other, expected in ((crossing, 0.2), (beyond, 1.0), (parallel, 0.3), (point, 0.4)):
        assert segment_distance(*a, *other) == pytest.approx(expected)
        assert segment_distance(*other, *a) == pytest.approx(expected)
