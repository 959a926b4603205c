"""Kinematics of a UR5 (CB3) that holds the cable's end over the board, and the room it takes up.

The base stands at the origin of the board's frame and is not turned. Angles are the controller's.
Of the eight solutions of the inverse kinematics the elbow-up one with the wrist reaching outwards
is used throughout.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from ur_analytic_ik import ur5  # pyright: ignore[reportAttributeAccessIssue]

from robotcast.casts.action import ToolMotion

JOINTS = ("base", "shoulder", "elbow", "wrist 1", "wrist 2", "wrist 3")

BASE_HEIGHT_M = 0.089159  # d1 in the maker's table
UPPER_ARM_M = 0.425  # -a2
FOREARM_M = 0.39225  # -a3
WRIST_1_M = 0.10915  # d4
WRIST_2_M = 0.09465  # d5
WRIST_3_M = 0.0823  # d6
SHOULDER_OFFSET_M = 0.13585  # to the upper arm's axis, which stands beside the base's
FOREARM_OFFSET_M = 0.01615  # to the forearm's axis


class Capsule(NamedTuple):
    """All points within `radius_m` of a piece that is drawn out by so much at its two ends."""

    radius_m: float
    before_m: float = 0.0
    beyond_m: float = 0.0


LINK_CAPSULES = {  # a capsule around each straight piece between consecutive `link_points`
    "column": Capsule(0.075, beyond_m=0.03),
    "shoulder": Capsule(0.068, beyond_m=0.04),
    "upper arm": Capsule(0.06),
    "elbow": Capsule(0.068, before_m=0.04, beyond_m=0.02),
    "forearm": Capsule(0.046),
    "wrist 1": Capsule(0.05, before_m=0.03, beyond_m=0.02),
    "wrist 2": Capsule(0.05, before_m=0.03, beyond_m=0.02),
    "wrist 3": Capsule(0.05, before_m=0.03),
    "gripper": Capsule(0.05),
    "fingers": Capsule(0.012),
}
"""They hold the collision meshes of the UR5 in ROS-Industrial's `ur_description` (commit a7a2c54,
made from the maker's models), but for the cable's connector at the foot. Joint housings reach
beyond the axes on which the pieces meet. The hand is what the gripper's sheet says, rounded up.
"""


@dataclass(frozen=True)
class Gripper:
    """What is mounted on the flange, and how high it holds the cable during a cast."""

    length_m: float = 0.17  # from the flange to the held end of the cable
    fingers_m: float = 0.06  # the slender last part of that length
    held_height_m: float = 0.02  # of the held end above the board

    def __post_init__(self) -> None:
        if not 0 < self.fingers_m < self.length_m < 0.5:
            raise ValueError(
                "gripper: expected 0 < fingers_m < length_m < 0.5 m, "
                f"got {self.fingers_m}, {self.length_m}"
            )
        if not 0 < self.held_height_m < 0.2:
            raise ValueError(
                f"gripper: held_height_m must be in (0, 0.2) m, got {self.held_height_m}"
            )


GRIPPER = Gripper()


def joints_pointing_down(pose: np.ndarray, gripper: Gripper = GRIPPER) -> np.ndarray:
    """Return the joint angles (..., 6) [rad] that hold the cable's end at board height.

    Closed form for a tool pointing straight down, whose end is at `pose` (..., 3): x [m], y [m],
    yaw [rad]. The angles are NaN where the arm does not reach.
    """
    x, y, yaw = np.moveaxis(np.asarray(pose, dtype=float), -1, 0)
    radius = np.hypot(x, y)
    with np.errstate(invalid="ignore", divide="ignore"):
        base = np.arctan2(y, x) + np.arcsin(WRIST_1_M / radius)
        outward = np.sqrt(radius**2 - WRIST_1_M**2) - WRIST_2_M
        upward = gripper.held_height_m + gripper.length_m + WRIST_3_M - BASE_HEIGHT_M
        square = outward**2 + upward**2
        bend = (square - UPPER_ARM_M**2 - FOREARM_M**2) / (2 * UPPER_ARM_M * FOREARM_M)
        elbow = -np.arccos(bend)
        beyond = FOREARM_M * np.sin(-elbow)
        along = UPPER_ARM_M + FOREARM_M * bend
    shoulder = np.arctan2(upward, outward) + np.arctan2(beyond, along) - np.pi
    wrist1 = -1.5 * np.pi - shoulder - elbow
    wrist2 = np.where(np.isnan(elbow), np.nan, np.pi / 2)
    return np.stack([base, shoulder, elbow, wrist1, wrist2, base - np.pi / 2 - yaw], axis=-1)


def joint_path(tool: ToolMotion, gripper: Gripper = GRIPPER) -> np.ndarray:
    """Return the joint angles along a cast, continuous in time, (n, 6) [rad]."""
    if not np.isfinite(tool.pose).all():
        raise ValueError("joint path: the tool motion holds values that are not finite")
    joints = joints_pointing_down(tool.pose, gripper)
    if (lost := np.isnan(joints).any(axis=1)).any():
        row = int(np.argmax(lost))
        x, y = tool.pose[row, :2]
        raise ValueError(
            f"joint path: the UR5 cannot hold ({x:.3f}, {y:.3f}) m pointing down "
            f"at t = {tool.t_s[row]:.3f} s"
        )
    joints[:, [0, 5]] += (np.unwrap(joints[:, 0]) - joints[:, 0])[:, None]
    return joints


def tilted_joint_path(
    position_m: np.ndarray, pitch_rad: np.ndarray, yaw_rad: np.ndarray, gripper: Gripper = GRIPPER
) -> np.ndarray:
    """Return the joint angles for a tool that pitches up, continuous in time, (n, 6) [rad].

    The held end is at `position_m` (n, 3); `pitch_rad` (n,) is 0 where the tool points down, as
    it must at first, and π/2 where it points along `yaw_rad` (n,), in which direction it pitches.
    """
    ahead = np.stack([np.cos(yaw_rad), np.sin(yaw_rad), np.zeros_like(yaw_rad)], axis=-1)
    up, cos, sin = np.array([0.0, 0.0, 1.0]), np.cos(pitch_rad)[:, None], np.sin(pitch_rad)[:, None]
    axis, side = sin * ahead - cos * up, cos * ahead + sin * up
    flange = np.tile(np.eye(4), (len(position_m), 1, 1))
    flange[:, :3, :3] = np.stack([side, np.cross(axis, side), axis], axis=-1)
    flange[:, :3, 3] = position_m - gripper.length_m * axis
    joints = np.empty((len(position_m), 6))
    last = joints_pointing_down(np.array([*position_m[0, :2], yaw_rad[0]]), gripper)
    for row, pose in enumerate(flange):
        solutions = ur5.inverse_kinematics_closest(pose, *last)
        if not solutions:
            raise ValueError(
                f"joint path: the UR5 cannot hold {np.round(position_m[row], 3).tolist()} m "
                f"at pitch {pitch_rad[row]:.3f} rad"
            )
        last = joints[row] = last + (solutions[0] - last + np.pi) % (2 * np.pi) - np.pi
    return joints


def link_points(joints: np.ndarray, gripper: Gripper = GRIPPER) -> np.ndarray:
    """Return the points (..., 11, 3) [m] that bound the links, from the base to the held end.

    `joints` has the shape (..., 6) [rad].
    """
    base, shoulder, elbow, wrist1, wrist2, _ = np.moveaxis(np.asarray(joints)[..., None], -2, 0)
    up = np.broadcast_to([0.0, 0.0, 1.0], (*base.shape[:-1], 3))
    ahead = np.concatenate([np.cos(base), np.sin(base), 0 * base], axis=-1)
    aside = np.concatenate([np.sin(base), -np.cos(base), 0 * base], axis=-1)

    def outward(angle: np.ndarray) -> np.ndarray:
        return -np.cos(angle) * ahead - np.sin(angle) * up

    total = shoulder + elbow + wrist1
    tool_axis = np.sin(wrist2) * outward(total) + np.cos(wrist2) * aside
    steps = [
        0 * up,
        BASE_HEIGHT_M * up,
        SHOULDER_OFFSET_M * aside,
        UPPER_ARM_M * outward(shoulder),
        (FOREARM_OFFSET_M - SHOULDER_OFFSET_M) * aside,
        FOREARM_M * outward(shoulder + elbow),
        (WRIST_1_M - FOREARM_OFFSET_M) * aside,
        WRIST_2_M * outward(total + np.pi / 2),
        WRIST_3_M * tool_axis,
        (gripper.length_m - gripper.fingers_m) * tool_axis,
        gripper.fingers_m * tool_axis,
    ]
    return np.cumsum(np.stack(steps, axis=-2), axis=-2)


def capsule_axes(points_m: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return both ends (..., 3) [m] of the axis of each link's capsule, from `link_points`."""
    axes = {}
    for index, (link, capsule) in enumerate(LINK_CAPSULES.items()):
        start, end = points_m[..., index, :], points_m[..., index + 1, :]
        along = (end - start) / np.linalg.norm(end - start, axis=-1, keepdims=True)
        axes[link] = start - capsule.before_m * along, end + capsule.beyond_m * along
    return axes


def segment_distance(
    start_a: np.ndarray, end_a: np.ndarray, start_b: np.ndarray, end_b: np.ndarray
) -> np.ndarray:
    """Return the distance between line segments (..., 3) [m] as (...).

    The closest points of two segments, after C. Ericson, Real-Time Collision Detection, 5.1.9:
    the closest pair on the infinite lines, clamped to one segment and then to the other.
    """
    u, v, w = end_a - start_a, end_b - start_b, start_a - start_b
    uu, vv, uv = np.vecdot(u, u), np.vecdot(v, v), np.vecdot(u, v)
    uw, vw = np.vecdot(u, w), np.vecdot(v, w)
    parallel, tiny = uu * vv - uv * uv, 1e-12
    s = np.where(parallel > tiny * uu * vv, uv * vw - uw * vv, 0.0)
    s = np.clip(s / np.maximum(parallel, tiny), 0.0, 1.0)
    t = np.clip((uv * s + vw) / np.maximum(vv, tiny), 0.0, 1.0)
    s = np.clip((uv * t - uw) / np.maximum(uu, tiny), 0.0, 1.0)
    return np.linalg.norm(w + s[..., None] * u - t[..., None] * v, axis=-1)
