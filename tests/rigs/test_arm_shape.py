"""The arm's capsules hold its housings, as ROS-Industrial's collision meshes of the UR5 have them.

Frames and sizes are those of `ur_description` (commit a7a2c54): every joint turns about its z.
"""

from dataclasses import dataclass

import numpy as np
import pytest

from robotcast.rigs.kinematics import (
    LINK_CAPSULES,
    LINKS,
    capsule_axis,
    link_points,
    segment_distance,
)

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
    for link in LINKS:
        start, end = capsule_axis(arm_m, link)
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
