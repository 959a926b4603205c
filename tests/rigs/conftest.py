from dataclasses import replace

import numpy as np
import pytest

from robotcast.casts.plan import PlanLimits, PlannedCast
from robotcast.measurements.measurement_set import Cable
from robotcast.rigs.kinematics import Gripper
from robotcast.rigs.virtual.cable import CableTruth, CastNoise
from robotcast.rigs.virtual.rig import VirtualRig
from tests.good_casts import plan_cast
from tests.rigs.small_rig import CABLE, R0_M, TRUTH, small_rig


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
    return small_rig(
        320,
        180,
        fps=60.0,
        marker_m=0.08,
        noise_grey=2.5,
        truth=TRUTH,
        gripper=Gripper(held_height_m=CABLE.radius_m),
    )


@pytest.fixture
def quiet_rig(rig: VirtualRig) -> VirtualRig:
    """The same rig without chance, its cable straight at the start."""
    straight = replace(rig.scatter, headings_rad=np.zeros_like(rig.scatter.headings_rad))
    return replace(rig, noise=CastNoise(0.0, 0.0, 0.0, 0.0, 0.0), scatter=straight)
