"""Making the virtual rig."""

from pathlib import Path
from typing import Any

from filmed_cable import build_tracker, weighed_cable
from grids import plain_config
from hydra.utils import instantiate
from omegaconf import DictConfig, OmegaConf
from stage import CONFIGURATION

from robotcast.rigs.kinematics import Gripper
from robotcast.rigs.virtual.arm import ArmDynamics, CastNoise, StartScatter, packaged_scatter
from robotcast.rigs.virtual.cable import CableTruth
from robotcast.rigs.virtual.picture import PictureSettings
from robotcast.rigs.virtual.rig import VirtualRig
from robotcast.vision.camera import Camera


def rig_with_cable(config: DictConfig, cable: str) -> VirtualRig:
    """Return the virtual rig with another cable than the configured one."""
    changed = config.copy()
    changed.cable = OmegaConf.load(Path(CONFIGURATION) / "cable" / f"{cable}.yaml")
    return build_virtual_rig(changed)


def build_virtual_rig(config: DictConfig, scatter: StartScatter | None = None) -> VirtualRig:
    """Return the virtual rig with the configured cable; `scatter` in place of the measured one."""
    plain: Any = plain_config(config)
    cable, camera = weighed_cable(config), plain["camera"]
    end_radius = float(plain["cable"]["endpoint_radius_m"])
    board = camera["board"]
    tracker = build_tracker(config)
    return VirtualRig(
        cable=cable,
        truth=CableTruth(**plain["cable"]["truth"], endpoint_radius_m=end_radius),
        r0_m=plain["casts"]["r0_m"],
        arm=ArmDynamics(**plain["rig"]["arm"]),
        noise=CastNoise(**plain["rig"]["noise"]),
        scatter=scatter or packaged_scatter(cable.name),
        gripper=Gripper(held_height_m=cable.radius_m),
        camera=Camera.overhead(**camera["lens"]),
        picture=PictureSettings(
            fiducials=tracker.fiducials,
            board_length_m=board["length_m"],
            board_width_m=board["width_m"],
            board_bgr=tracker.board_bgr,
            endpoint_bgr=tracker.endpoint_bgr,
            **camera["picture"],
        ),
        tracker=tracker,
        seed=plain["seed"],
        workers=plain["rig"]["workers"],
        hidden=tuple(instantiate(effect) for effect in config.rig.hidden),
    )
