"""A UR5 rig for the peer, small and with quick resets, and what its camera looks at."""

from dataclasses import replace
from typing import Any

import numpy as np

from robotcast.build import build
from robotcast.casts.reset import ResetSettings
from robotcast.rigs.kinematics import GRIPPER, joints_pointing_down
from robotcast.rigs.ur5.arm import ServoSettings, WatchSettings
from robotcast.rigs.ur5.camera import WebcamSettings
from robotcast.rigs.ur5.motion import SafetyLimits
from robotcast.rigs.ur5.rig import RunSettings, Ur5Rig
from robotcast.rigs.virtual.rig import VirtualRig
from tests.rigs.peer.process import Peer
from tests.rigs.small_rig import CABLE, R0_M, TRUTH, small_rig
from tests.stages import configured

LIGHT = replace(TRUTH, segments=15, step_s=0.002)  # to simulate
HOME_RAD = tuple(joints_pointing_down(np.array([R0_M, 0.0, 0.0])))
QUICK_RESET = ResetSettings(
    lift_s=1.2, raise_s=0.6, hang_s=0.1, settle_s=0.1, pull_s=0.6, rest_s=0.1
)
CASTS = configured().casts
CAST_ENVELOPE, RESET_ENVELOPE = build(CASTS.envelope), build(CASTS.reset_envelope)
LIMITS = SafetyLimits(RESET_ENVELOPE, CAST_ENVELOPE, (2000.0,) * 6, 0.02)


def scene(fps: float = 30.0) -> VirtualRig:
    """What the peer's camera films: the virtual rig's board, cable and lens."""
    picture = f"camera.picture={{fps: {fps}, noise_grey: 1.0}}", "camera.fiducials.side_m=0.1"
    return small_rig(800, 450, *picture, truth=LIGHT, gripper=GRIPPER)


def ur5_rig(peer: Peer, filmed: VirtualRig, **changes: Any) -> Ur5Rig:
    """Return the rig that a stage would make for this peer, with quick resets."""
    said: list[str] = []
    rig = Ur5Rig(
        cable=CABLE,
        r0_m=R0_M,
        host=peer.host,
        limits=LIMITS,
        gripper=GRIPPER,
        reset=QUICK_RESET,
        servo=ServoSettings(watchdog_hz=0.2),
        watch=WatchSettings(stale_s=8.0),  # a busy machine shall not decide a test
        webcam=WebcamSettings(
            peer.camera, filmed.camera.width, filmed.camera.height, filmed.picture.fps, gone_s=8.0
        ),
        tracker=filmed.tracker,
        run=RunSettings(first_speed=1.0, rest_s=1.0, most_missed=0.5),
        confirm=lambda _text: True,
        tell=said.append,
    )
    return replace(rig, **changes)
