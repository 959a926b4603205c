"""The model with what was found, as an MJCF file: parameters that were fitted, effects, or both."""

import os
from collections.abc import Mapping, Sequence
from copy import copy
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from robotcast.robots.couplings import serve
from robotcast.robots.effect import RobotEffect
from robotcast.robots.effects import in_file
from robotcast.robots.model_fields import OneModel
from robotcast.robots.names import FIELDS, Address, loose
from robotcast.robots.robot_file import Moving, RobotFile, compiled, load_spec

OF_JOINTS = {field: name for name, field in FIELDS["joint"].items()}


def write_patched(
    robot: RobotFile, effects: Mapping[str, RobotEffect], said: Mapping[str, Any], path: Path
) -> list[str]:
    """Write the model that a diagnosis ended with; return the effects that MJCF cannot hold.

    What is `said` is `model` of diagnosis.json: the effects that act, every parameter's value.
    """
    values = {name: size["value"] for name, size in said["parameters"].items()}
    acting = [
        (effects[name], {p.name: values[f"{name}.{p.name}"] for p in effects[name].parameters})
        for name in said["effects"]
    ]
    tuned = [values[one.at.name] for one in robot.tune]
    spec, left_out = patched(robot, tuned, acting)
    spec.meshdir = os.path.relpath(robot.model_path.parent / spec.meshdir, path.parent)
    path.parent.mkdir(parents=True, exist_ok=True)
    spec.to_file(str(path))
    return left_out


def patched(
    robot: RobotFile,
    tuned: Sequence[float],
    acting: Sequence[tuple[RobotEffect, Mapping[str, float]]],
) -> tuple[mujoco.MjSpec, list[str]]:
    """Return the model with fitted parameters and effects, and the names of those left out."""
    fields = OneModel(copy(robot.model))
    for one, value in zip(robot.tune, tuned, strict=True):
        (fields.multiply if one.factor else fields.set)(one.at, np.array([[value]]))
    spec = load_spec(robot.model_path)
    moving: Any = Moving(spec, robot.weld)
    serve(moving, robot.servos, str(robot.path))
    left_out = []
    zeros = [one for one in acting if one[0].acts_through("closes")]
    for effect, values in (one for one in acting if one not in zeros):
        held = not loose(robot.model)[list(effect.where.dofs)].any()  # MJCF has one number for all
        before = len(fields.changed)
        if effect.acts_through("write") and (held or effect.part != "joint"):
            effect.write(fields, **{name: np.array([[v]]) for name, v in values.items()})
        if not effect.patch(moving, robot.model, **values) and before == len(fields.changed):
            left_out.append(effect.name)
    for at in fields.changed:
        _copy(fields.model, moving, at)
    for effect, values in zeros:  # last, when all positions are written that move along
        if not effect.patch(moving, robot.model, **values):
            left_out.append(effect.name)
    compiled(spec, robot.model_path)
    return spec, left_out


def _copy(model: mujoco.MjModel, spec: mujoco.MjSpec, at: Address) -> None:
    """Write the addressed elements of a model into the spec that it was compiled from."""
    if at.field.startswith("opt."):
        setattr(spec.option, at.field[4:], getattr(model.opt, at.field[4:]))
        return
    values = getattr(model, at.field)
    for row in at.rows:
        if at.field in OF_JOINTS:
            owner, name = spec.joints[_joint(model, at.field, row)], OF_JOINTS[at.field]
            if name == "springref":
                owner.springref = in_file(spec, owner, float(values[row]))
            elif name == "dampingpoly":
                owner.damping[1:] = values[row]
            elif name in ("damping", "stiffness"):
                getattr(owner, name)[0] = values[row]
            else:
                setattr(owner, name, float(values[row]))
        elif at.field.startswith("body_"):
            body = spec.bodies[row]
            body.explicitinertial = True
            body.mass, body.ipos = float(model.body_mass[row]), model.body_ipos[row]
            body.inertia, body.iquat = model.body_inertia[row], model.body_iquat[row]
        else:
            kind, _, name = at.field.partition("_")
            owner = getattr(spec, f"{kind}s")[row]
            many = np.ndim(getattr(owner, name)) > 0
            setattr(owner, name, np.atleast_1d(values[row]) if many else float(values[row]))


def _joint(model: mujoco.MjModel, field: str, row: int) -> int:
    if field.startswith("dof_"):
        return int(model.dof_jntid[row])
    return row if field.startswith("jnt_") else int(np.flatnonzero(model.jnt_qposadr == row)[0])
