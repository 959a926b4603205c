"""Making the UR5 rig."""

import sys
from dataclasses import replace
from typing import Any

from filmed_cable import build_tracker, weighed_cable
from grids import build_envelope, build_reset, plain_config
from omegaconf import DictConfig
from stage import console

from robotcast.rigs.envelope import ToolBox
from robotcast.rigs.ur5.arm import WatchSettings
from robotcast.rigs.ur5.camera import WebcamSettings
from robotcast.rigs.ur5.controller import ServoSettings, require_ur_rtde
from robotcast.rigs.ur5.motion import SafetyLimits
from robotcast.rigs.ur5.rig import RunSettings, Ur5Rig


def build_ur5_rig(config: DictConfig) -> Ur5Rig:
    """Return the UR5 with its camera; nothing is connected before the first cast."""
    plain: Any = plain_config(config)
    rig = plain["rig"]
    if not rig["dry_run"]:
        for name, what in (("host", "the controller's address"), ("camera", "0 or /dev/video0")):
            if rig[name] is None:
                raise ValueError(f"rig=ur5 needs rig.{name}=… ({what})")
        require_ur_rtde()
    cast = build_envelope(config)
    reset = replace(cast, box=ToolBox(**plain["casts"]["envelope"]["reset_box"]))
    source = "" if rig["camera"] is None else str(rig["camera"])
    sizes = {name: rig[name] for name in ("width", "height", "fps", "exposure", "focus")}
    return Ur5Rig(
        cable=weighed_cable(config),
        r0_m=plain["casts"]["r0_m"],
        host=str(rig["host"]),
        limits=SafetyLimits(reset=reset, cast=cast, **rig["safety"]),
        gripper=cast.gripper,
        reset=replace(build_reset(config), held_height_m=cast.gripper.held_height_m),
        servo=ServoSettings(**rig["servo"]),
        watch=WatchSettings(**rig["watch"]),
        webcam=WebcamSettings(source=source, **sizes),
        tracker=build_tracker(config),
        run=RunSettings(**rig["run"]),
        confirm=_confirmed if rig["confirm"] == "yes" else _ask_operator,
        tell=lambda text: console.print(text, markup=False),
    )


def _ask_operator(text: str) -> bool:
    if not sys.stdin.isatty():
        raise ValueError(
            "rig=ur5 asks an operator who stands beside the robot: run it in a terminal, or say "
            "rig.confirm=yes when somebody watches the arm"
        )
    console.print(text, markup=False)
    return console.input("Hand on the emergency stop? Type yes: ").strip().lower() == "yes"


def _confirmed(text: str) -> bool:
    console.print(text, markup=False)
    return True
