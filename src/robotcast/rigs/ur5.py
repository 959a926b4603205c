"""Kinematics of a UR5 (CB3) that holds the cable's end over the board.

The base stands at the origin of the board's frame and is not turned. Angles are those of
the controller: base, shoulder, elbow, wrist 1, wrist 2, wrist 3. Of the eight solutions of
the inverse kinematics the elbow-up one with the wrist reaching outwards is used throughout.
"""

from dataclasses import dataclass

import numpy as np
from ur_analytic_ik import ur5  # pyright: ignore[reportAttributeAccessIssue]

from robotcast.casts.tool_motion import ToolMotion

JOINTS = ("base", "shoulder", "elbow", "wrist 1", "wrist 2", "wrist 3")
LINKS = (
    "column",
    "shoulder",
    "upper arm",
    "elbow",
    "forearm",
    "wrist 1",
    "wrist 2",
    "wrist 3",
    "gripper",
    "fingers",
)
"""The straight pieces between consecutive points of `link_points`."""

BASE_HEIGHT_M = 0.089159  # d1 in the maker's table
UPPER_ARM_M = 0.425  # -a2
FOREARM_M = 0.39225  # -a3
WRIST_1_M = 0.10915  # d4
WRIST_2_M = 0.09465  # d5
WRIST_3_M = 0.0823  # d6
SHOULDER_OFFSET_M = 0.13585  # to the upper arm's axis, which stands beside the base's
FOREARM_OFFSET_M = 0.01615  # to the forearm's axis


@dataclass(frozen=True)
class Gripper:
    """What is mounted on the flange, and how high it holds the cable during a cast.

    Attributes
    ----------
    length_m : from the flange to the held end of the cable, along the flange's axis.
    fingers_m : the slender last part of that length.
    held_height_m : height of the held end above the board during a cast.
    """

    length_m: float = 0.17
    fingers_m: float = 0.06
    held_height_m: float = 0.02

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
    """Return the joint angles that hold the cable's end at board height, (..., 6) [rad].

    Closed form for a tool pointing straight down: the base from the wrist's offset, shoulder
    and elbow as a planar arm of two links, the wrist from what remains.

    Parameters
    ----------
    pose : ndarray of shape (..., 3), x [m], y [m], yaw [rad] of the held end.

    Returns
    -------
    ndarray of shape (..., 6), NaN where the arm does not reach.
    """
    x, y, yaw = np.moveaxis(np.asarray(pose, dtype=float), -1, 0)
    joints = np.empty((*x.shape, 6))
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
    joints[..., 0] = base
    joints[..., 1] = shoulder
    joints[..., 2] = elbow
    joints[..., 3] = -1.5 * np.pi - shoulder - elbow
    joints[..., 4] = np.where(np.isnan(elbow), np.nan, np.pi / 2)
    joints[..., 5] = base - np.pi / 2 - yaw
    return joints


def joint_path(tool: ToolMotion, gripper: Gripper = GRIPPER) -> np.ndarray:
    """Return the joint angles along a cast, continuous in time, (n, 6) [rad]."""
    if not np.isfinite(tool.pose).all():
        raise ValueError("joint path: the tool motion holds values that are not finite")
    joints = joints_pointing_down(tool.pose, gripper)
    lost = np.isnan(joints).any(axis=1)
    if lost.any():
        row = int(np.argmax(lost))
        x, y = tool.pose[row, :2]
        raise ValueError(
            f"joint path: the UR5 cannot hold ({x:.3f}, {y:.3f}) m pointing down "
            f"at t = {tool.t_s[row]:.3f} s"
        )
    turns = np.unwrap(joints[:, 0]) - joints[:, 0]
    joints[:, 0] += turns
    joints[:, 5] += turns
    return joints


def tilted_joint_path(
    position_m: np.ndarray, pitch_rad: np.ndarray, yaw_rad: np.ndarray, gripper: Gripper = GRIPPER
) -> np.ndarray:
    """Return the joint angles for a tool that pitches up, continuous in time, (n, 6) [rad].

    Parameters
    ----------
    position_m : ndarray of shape (n, 3), the held end; the first pose points down and fixes
        the branch.
    pitch_rad : ndarray of shape (n,), 0 pointing down, π/2 pointing along the yaw.
    yaw_rad : ndarray of shape (n,), direction in which the tool pitches.
    """
    joints = np.empty((len(position_m), 6))
    last = joints_pointing_down(np.array([*position_m[0, :2], yaw_rad[0]]), gripper)
    for row, (position, pitch, yaw) in enumerate(zip(position_m, pitch_rad, yaw_rad, strict=True)):
        solutions = ur5.inverse_kinematics_closest(
            _flange_pose(position, pitch, yaw, gripper), *last
        )
        if not solutions:
            raise ValueError(
                f"joint path: the UR5 cannot hold {np.round(position, 3).tolist()} m "
                f"at pitch {pitch:.3f} rad"
            )
        last = last + (solutions[0] - last + np.pi) % (2 * np.pi) - np.pi
        joints[row] = last
    return joints


def _flange_pose(position: np.ndarray, pitch: float, yaw: float, gripper: Gripper) -> np.ndarray:
    ahead = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    axis = np.sin(pitch) * ahead - np.cos(pitch) * up
    side = np.cos(pitch) * ahead + np.sin(pitch) * up
    pose = np.eye(4)
    pose[:3, :3] = np.stack([side, np.cross(axis, side), axis], axis=1)
    pose[:3, 3] = position - gripper.length_m * axis
    return pose


def link_points(joints: np.ndarray, gripper: Gripper = GRIPPER) -> np.ndarray:
    """Return the points between the arm's straight pieces, from the base to the held end.

    Parameters
    ----------
    joints : ndarray of shape (..., 6) [rad].

    Returns
    -------
    ndarray of shape (..., 11, 3) [m]; consecutive points bound the `LINKS`.
    """
    base, shoulder, elbow, wrist1, wrist2, _ = np.moveaxis(np.asarray(joints), -1, 0)
    zero = np.zeros_like(base)
    up = np.stack([zero, zero, zero + 1], axis=-1)
    ahead = np.stack([np.cos(base), np.sin(base), zero], axis=-1)
    aside = np.stack([np.sin(base), -np.cos(base), zero], axis=-1)

    def outward(angle: np.ndarray) -> np.ndarray:
        return -np.cos(angle)[..., None] * ahead - np.sin(angle)[..., None] * up

    total = shoulder + elbow + wrist1
    wrist2_axis = outward(total + np.pi / 2)
    tool_axis = np.sin(wrist2)[..., None] * outward(total) + np.cos(wrist2)[..., None] * aside
    steps = [
        np.zeros_like(up),
        BASE_HEIGHT_M * up,
        SHOULDER_OFFSET_M * aside,
        UPPER_ARM_M * outward(shoulder),
        (FOREARM_OFFSET_M - SHOULDER_OFFSET_M) * aside,
        FOREARM_M * outward(shoulder + elbow),
        (WRIST_1_M - FOREARM_OFFSET_M) * aside,
        WRIST_2_M * wrist2_axis,
        WRIST_3_M * tool_axis,
        (gripper.length_m - gripper.fingers_m) * tool_axis,
        gripper.fingers_m * tool_axis,
    ]
    return np.cumsum(np.stack(steps, axis=-2), axis=-2)
