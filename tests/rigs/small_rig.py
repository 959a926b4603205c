"""The configured virtual rig of cable 1 with a small picture, for tests."""

from pathlib import Path
from typing import Any

from hydra import compose, initialize_config_dir
from omegaconf import DictConfig

from robotcast.build import build_rig
from robotcast.casts.plan import PlanLimits
from robotcast.rigs.virtual.rig import VirtualRig
from tests.good_casts import plan_cast


def configured(*overrides: str) -> DictConfig:
    with initialize_config_dir(str(Path(__file__).parents[2] / "conf"), version_base=None):
        return compose("config", list(overrides))


def small_rig(width: int, height: int, *overrides: str, **changes: Any) -> VirtualRig:
    """Return the rig with a picture of this size, and with other parts."""
    size = f"scale.camera={{width: {width}, height: {height}}}"
    return build_rig(configured(size, "rig.workers=1", *overrides), **changes)


RIG = small_rig(320, 180)
CABLE, TRUTH, R0_M = RIG.cable, RIG.truth, RIG.r0_m
SHORT_CAST = plan_cast(0.3, -0.2, 0.7, 0.3, 1.4, r0_m=R0_M, limits=PlanLimits())
