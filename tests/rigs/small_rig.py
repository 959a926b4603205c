"""The configured virtual rig of cable 1 with a small picture, for tests."""

from typing import Any

from robotcast.build import build_rig
from robotcast.casts.plan import PlanLimits
from robotcast.rigs.virtual.rig import VirtualRig
from tests.good_casts import plan_cast
from tests.stages import configured


def small_rig(width: int, height: int, *overrides: str, **changes: Any) -> VirtualRig:
    """Return the rig with a picture of this size, and with other parts."""
    size = f"scale.camera={{width: {width}, height: {height}}}"
    return build_rig(configured(size, "rig.workers=1", *overrides), **changes)


RIG = small_rig(320, 180)
CABLE, TRUTH, R0_M = RIG.cable, RIG.truth, RIG.r0_m
SHORT_CAST = plan_cast(0.3, -0.2, 0.7, 0.3, 1.4, r0_m=R0_M, limits=PlanLimits())
