"""Filming a cast: the video, and when its frames and the cast's start were."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robotcast.rigs.ur5_robot.arm import Arm
from robotcast.rigs.ur5_robot.motion import JointMotion
from robotcast.rigs.ur5_robot.stream import RobotLog
from robotcast.rigs.ur5_robot.webcam import Webcam
from robotcast.sessions.cast_files import VIDEO_FILE

BEFORE_S = 0.3  # filmed before the start
REST_FILM_S = 0.5  # filmed at rest, of a cast whose rest alone is wanted


@dataclass(frozen=True)
class Film:
    """When a film was taken.

    Attributes
    ----------
    start_s : of the cast, by the controller's clock.
    frames_s : ndarray of shape (k,), when each frame was taken, from the cast's start on.
    known : ndarray of shape (k,) of bool, whether the controller was heard at that time.
    """

    start_s: float
    frames_s: np.ndarray
    known: np.ndarray


def film_cast(
    arm: Arm,
    camera: Webcam,
    cast: JointMotion,
    folder: Path,
    log: RobotLog,
    *,
    rest_s: float,
    camera_offset_s: float,
    rest_only: bool,
) -> Film:
    """Run a cast that was checked and film it into `folder` until the cable rests.

    Parameters
    ----------
    log : receives every cycle, also of a cast that fails.
    rest_s : how long the arm stands still at its end.
    camera_offset_s : by how much frames are stamped late.
    """
    period_s = arm.robot.period_s
    moved = cast.held(BEFORE_S, rest_s, period_s)
    resting = len(moved.t_s) - round(REST_FILM_S / period_s)
    parts = [
        JointMotion(moved.t_s[part], moved.joints_rad[part])
        for part in (slice(0, resting), slice(resting, None))
    ]

    def before(part: int) -> None:
        if rest_only and part:
            camera.start_recording(folder / VIDEO_FILE)

    try:
        if not rest_only:
            camera.start_recording(folder / VIDEO_FILE)
        arm.follow(parts, log, before=before)
    finally:
        seen_s = camera.stop_recording()
    start_s = float(log.states[round(BEFORE_S / period_s)].t_s)
    known = (seen_s >= log.states[0].heard_s) & (seen_s <= log.states[-1].heard_s)
    return Film(start_s, log.controller_time(seen_s) - camera_offset_s - start_s, known)
