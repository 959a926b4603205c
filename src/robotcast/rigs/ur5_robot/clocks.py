"""Comparing the camera's clock, and the arm's kinematics, with the controller's own."""

from dataclasses import dataclass

import numpy as np

from robotcast.rigs.ur5 import link_points
from robotcast.rigs.ur5_robot.arm import Arm
from robotcast.rigs.ur5_robot.camera_time import ArmPixels, camera_offset
from robotcast.rigs.ur5_robot.motion import JointMotion
from robotcast.rigs.ur5_robot.sight import Sight
from robotcast.rigs.ur5_robot.stream import RobotLog
from robotcast.rigs.ur5_robot.webcam import require_rate

STILL_S = 0.3  # before and after the swaying


@dataclass(frozen=True)
class Clocks:
    """What the arm's swaying before the camera told.

    Attributes
    ----------
    camera_offset_s : by how much frames are stamped late.
    frames_per_s : that the camera gives.
    kinematic_difference_m : mean distance of the controller's tool place from ours.
    """

    camera_offset_s: float
    frames_per_s: float
    kinematic_difference_m: float


def compare_clocks(arm: Arm, sight: Sight, swaying: JointMotion, held_m: float) -> Clocks:
    """Sway the arm, as was checked, and see when the picture follows.

    Parameters
    ----------
    held_m : how far from the base the arm holds the cable.
    """
    pixels = ArmPixels(sight.calibrated(sight.camera.picture()), held_m)
    log, pictures, seen_s = RobotLog(), [], []

    def look() -> None:
        newest, at_s = sight.camera.newest()
        if not seen_s or at_s > seen_s[-1]:
            pictures.append(pixels.of(newest))
            seen_s.append(at_s)

    arm.follow([swaying.held(STILL_S, STILL_S, arm.robot.period_s)], log, look)
    times_s = log.controller_time(np.array(seen_s))
    rate = require_rate(times_s, sight.camera.settings)
    joints_rad = log.column("joints_rad")
    offset_s = camera_offset(np.array(pictures), times_s, log.column("t_s"), joints_rad[:, 0])
    ours_m = link_points(joints_rad, arm.gripper)[:, -1]
    away_m = np.linalg.norm(ours_m - log.column("tool_pose")[:, :3], axis=1)
    return Clocks(offset_s, rate, float(away_m.mean()))
