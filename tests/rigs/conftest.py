from dataclasses import replace

import numpy as np
import pytest

from robotcast.casts.plan import PlanLimits, PlannedCast, plan_cast
from robotcast.measurements.measurement_set import Cable
from robotcast.rigs.ur5 import Gripper
from robotcast.rigs.virtual.arm import ArmDynamics
from robotcast.rigs.virtual.cable import CableTruth
from robotcast.rigs.virtual.chance import CastNoise
from robotcast.rigs.virtual.picture import PictureSettings
from robotcast.rigs.virtual.rig import VirtualRig
from robotcast.rigs.virtual.scatter import packaged_scatter
from robotcast.vision.camera import Camera
from robotcast.vision.facts import TrackerFacts
from robotcast.vision.fiducials import FiducialBoard

R0_M = 0.6
CABLE = Cable("cable1", 0.63, 0.008, 0.0045, 0.02)
TRUTH = CableTruth(
    friction=0.35,
    bending_stiffness_n_m2=4e-4,
    bending_damping_s=0.12,
    hysteresis_n_m=3e-5,
    tightest_bend_m=0.014,
    endpoint_radius_m=0.015,
)


@pytest.fixture
def cable() -> Cable:
    return CABLE


@pytest.fixture
def truth() -> CableTruth:
    return TRUTH


@pytest.fixture
def short_cast() -> PlannedCast:
    return plan_cast(0.3, -0.2, 0.7, 0.3, 1.4, r0_m=R0_M, limits=PlanLimits())


@pytest.fixture
def rig() -> VirtualRig:
    """A virtual rig with a small picture."""
    fiducials = FiducialBoard.along_edges(1.55, 2.45, side_m=0.08, margin_m=0.07, spacing_m=0.35)
    picture = PictureSettings(
        fiducials=fiducials,
        board_length_m=1.55,
        board_width_m=2.45,
        fps=60.0,
        exposure_s=0.004,
        noise_grey=2.5,
        vignetting=0.12,
        board_bgr=(150.0, 85.0, 35.0),
        endpoint_bgr=(150.0, 30.0, 240.0),
        cable_bgr=(205.0, 210.0, 215.0),
    )
    tracker = TrackerFacts(
        period_s=0.1,
        exposure_s=picture.exposure_s,
        focal_widths=0.7,
        endpoint_radius_m=TRUTH.endpoint_radius_m,
        endpoint_height_m=CABLE.radius_m,
        endpoint_bgr=picture.endpoint_bgr,
        board_bgr=picture.board_bgr,
        fiducials=fiducials,
    )
    return VirtualRig(
        cable=CABLE,
        truth=TRUTH,
        r0_m=R0_M,
        arm=ArmDynamics(),
        noise=CastNoise(),
        scatter=packaged_scatter("cable1"),
        gripper=Gripper(held_height_m=CABLE.radius_m),
        camera=Camera.overhead(320, 180, focal_widths=0.7, position_m=(0.8, 0.0, 2.2)),
        picture=picture,
        tracker=tracker,
    )


@pytest.fixture
def quiet_rig(rig: VirtualRig) -> VirtualRig:
    """The same rig without chance, its cable straight at the start."""
    straight = replace(rig.scatter, headings_rad=np.zeros_like(rig.scatter.headings_rad))
    return replace(rig, noise=CastNoise(0.0, 0.0, 0.0, 0.0, 0.0), scatter=straight)
