"""A UR5 rig for the peer, small and with quick resets, and what its camera looks at."""

from dataclasses import replace
from typing import Any

import numpy as np

from robotcast.casts.plan import PlanLimits, PlannedCast
from robotcast.casts.reset import ResetSettings
from robotcast.rigs.envelope import Envelope, ToolBox
from robotcast.rigs.kinematics import GRIPPER, joints_pointing_down
from robotcast.rigs.ur5.arm import ServoSettings, WatchSettings
from robotcast.rigs.ur5.camera import WebcamSettings
from robotcast.rigs.ur5.motion import SafetyLimits
from robotcast.rigs.ur5.rig import RunSettings, Ur5Rig
from robotcast.rigs.virtual.rig import VirtualRig
from tests.good_casts import plan_cast
from tests.rigs.peer.process import Peer
from tests.rigs.small_rig import CABLE, R0_M, TRUTH, small_rig

LIGHT = replace(TRUTH, segments=15, step_s=0.002)  # to simulate
HOME_RAD = tuple(joints_pointing_down(np.array([R0_M, 0.0, 0.0])))
WIDTH, HEIGHT = 800, 450
QUICK_RESET = ResetSettings(
    lift_s=1.2, raise_s=0.6, hang_s=0.1, settle_s=0.1, pull_s=0.6, rest_s=0.1
)
TURNS = (6.2832, 6.2832, 3.1416, 6.2832, 6.2832, 6.2832)
CAST_ENVELOPE = Envelope(
    joint_min_rad=tuple(-t for t in TURNS),
    joint_max_rad=TURNS,
    joint_speed_rad_s=(3.1416,) * 6,
    joint_acceleration_rad_s2=(40.0,) * 6,
    tool_speed_m_s=2.5,
    clearance_m=0.01,
    box=ToolBox((0.0, 1.55), (-1.225, 1.225), (0.005, 0.05), 0.5),
    gripper=GRIPPER,
)
RESET_ENVELOPE = replace(
    CAST_ENVELOPE, box=ToolBox((0.1, 1.55), (-1.225, 1.225), (0.005, 0.9), 0.3)
)
LIMITS = SafetyLimits(RESET_ENVELOPE, CAST_ENVELOPE, (2000.0,) * 6, 0.02)


def small_cast() -> PlannedCast:
    """A short, quick cast."""
    return plan_cast(0.3, -0.2, 0.7, 0.3, 1.4, r0_m=R0_M, limits=PlanLimits())


def scene(width: int = WIDTH, height: int = HEIGHT, fps: float = 30.0) -> VirtualRig:
    """What the peer's camera films: the virtual rig's board, cable and lens."""
    return small_rig(
        width, height, fps=fps, marker_m=0.1, noise_grey=1.0, truth=LIGHT, gripper=GRIPPER
    )


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
