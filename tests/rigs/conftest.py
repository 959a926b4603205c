from dataclasses import replace

import numpy as np
import pytest

from robotcast.casts.plan import PlannedCast
from robotcast.measurements.measurement_set import Cable
from robotcast.rigs.virtual.cable import CableTruth, CastNoise
from robotcast.rigs.virtual.rig import VirtualRig
from tests.rigs.small_rig import CABLE, RIG, SHORT_CAST, TRUTH


@pytest.fixture
def cable() -> Cable:
    return CABLE


@pytest.fixture
def truth() -> CableTruth:
    return TRUTH


@pytest.fixture
def short_cast() -> PlannedCast:
    return SHORT_CAST


@pytest.fixture
def rig() -> VirtualRig:
    return RIG


@pytest.fixture
def quiet_rig(rig: VirtualRig) -> VirtualRig:
    """The rig without chance, its cable straight at the start."""
    straight = replace(rig.scatter, headings_rad=np.zeros_like(rig.scatter.headings_rad))
    return replace(rig, noise=CastNoise(0.0, 0.0, 0.0, 0.0, 0.0), scatter=straight)
