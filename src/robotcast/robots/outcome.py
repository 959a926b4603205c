"""What a robot's diagnosis hands out: what its page shows, as plain data, and an MJCF file.

The file holds the model with what was found: parameters that were fitted, effects, or both.
"""

import os
from collections.abc import Mapping, Sequence
from copy import copy
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from robotcast.diagnosis.rule import Rule
from robotcast.robots.couplings import insert, serve
from robotcast.robots.effect import RobotEffect
from robotcast.robots.model_fields import OneModel
from robotcast.robots.names import FIELDS, Address, in_file, inserted, loose, name_of_dof, turning
from robotcast.robots.robot_case import RobotCase
from robotcast.robots.robot_file import Moving, RobotFile, compiled, load_spec
from robotcast.robots.sizes import dynamics

QUANTILES = (0.5, 0.9, 1.0)  # of the windows, by what the model as it is misses
OF_JOINTS = {field: name for name, field in FIELDS["joint"].items()}


def shown(
    case: RobotCase,
    base: Mapping[str, Any],
    last: Mapping[str, Any],
    least_noise: float = Rule.least_noise,
) -> dict[str, Any]:
    """Return `robot` of diagnosis.json: windows with traces, and torques against speed.

    From its `base` and its `model`, the last, which may be empty.
    """
    before = _predicted(case, (), [p["value"] for p in base["parameters"].values()])
    after = before
    if last:
        after = _predicted(case, last["effects"], [p["value"] for p in last["parameters"].values()])
    return {**_traces(case, before, after, least_noise), "torques": _torques(case)}


def preview(case: RobotCase) -> dict[str, Any]:
    """Return signals and windows of the model as the file has it."""
    path = _predicted(case, (), [p.nominal for p in case.model.parameters])
    return _traces(case, path, path, Rule.least_noise)


def _predicted(case: RobotCase, effects: Sequence[str], values: Sequence[float]) -> np.ndarray:
    return case.model.predict(case.model.records, effects, np.array([values], float))[0]


def _traces(
    case: RobotCase, before: np.ndarray, after: np.ndarray, least_noise: float
) -> dict[str, Any]:
    """Return signals with what is missed of them, and windows with their traces, in their units."""
    model, axes = case.model, case.wording.axes
    scale = np.array([axis.scale for axis in axes])
    off, off_after = model.misses(before), model.misses(after)
    size = [float(np.nanmean(np.linalg.norm(one, axis=1))) for one in off]
    order = np.argsort(np.nan_to_num(size, nan=np.inf), kind="stable")
    found = []
    for share in QUANTILES:
        record = model.records[order[round(share * (len(order) - 1))]]
        k, window = len(record.times_s), model.rollout.windows[record.trial]
        log = model.rollout.logs[window.log]
        found.append(
            {
                "window": record.trial,
                "log": log.path.relative_to(case.robot.path.parent).as_posix(),
                "start_s": log.times_s[window.first] - log.times_s[0],
                "times_s": record.times_s,
                "measured": record.measured * scale,
                "base": before[record.trial, :k] * scale,
                "model": after[record.trial, :k] * scale,
            }
        )
    floors = scale * case.signal_floors(least_noise)
    usual = [scale * model.usual_misses(some) for some in (off, off_after)]
    signals = [
        {"name": axis.name, "unit": axis.unit, "base": base, "model": last, "floor": least}
        for axis, base, last, least in zip(axes, *usual, floors, strict=True)
    ]
    return {"signals": signals, "floor": case.wording.floor, "windows": found}


def _torques(case: RobotCase) -> list[dict[str, Any]]:
    """Return of every joint, at states of the logs, what it was driven by less what it needed.

    By the model as it is: dry friction shows as a step, viscous friction as a slope.
    """
    robot, logs = case.robot, case.model.rollout.logs
    of, straight = dynamics(robot, logs, case.starts), ~turning(robot.model)
    degrees = any(column.unit == "deg" for column in robot.measured.values())
    found = []
    for dof, hinge in enumerate(case.sizes.hinge):
        length = ("deg" if degrees else "rad") if hinge else "m"
        scale = np.degrees(1.0) if length == "deg" else 1.0
        found.append(
            {
                "joint": name_of_dof(robot.model, dof),
                "units": {"length": length, "torque": "N m" if hinge else "N"},
                "position": scale * straight[dof] * of.position[:, dof],
                "speed": scale * of.speed[:, dof],
                "torque": of.missing[:, dof],
            }
        )
    return found


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
    rows = {t for effect, _ in acting for t in effect.where.tendons}
    rows |= {t for one in robot.tune if one.at.field.startswith("tendon_") for t in one.at.rows}
    between = inserted(robot.model)
    for tendon in sorted(rows & {*between}):
        insert(moving, *between[tendon])
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
            else:
                _put(owner, name, values[row])
        elif at.field.startswith("body_"):
            body = spec.bodies[row]
            body.gravcomp = float(model.body_gravcomp[row])
            if at.field == "body_gravcomp":
                continue
            body.explicitinertial = True
            body.mass, body.ipos = float(model.body_mass[row]), model.body_ipos[row]
            body.inertia, body.iquat = model.body_inertia[row], model.body_iquat[row]
        else:
            kind, _, name = at.field.partition("_")
            inner = kind == "tendon" and row in inserted(model)
            one = spec.tendon(model.tendon(row).name) if inner else getattr(spec, f"{kind}s")[row]
            _put(one, name, values[row])


def _put(owner: Any, name: str, values: np.ndarray) -> None:
    """Write a number of a spec, or the first ones where it holds more than the model."""
    if np.ndim(getattr(owner, name)):
        getattr(owner, name)[: np.size(values)] = values
    else:
        setattr(owner, name, float(values))


def _joint(model: mujoco.MjModel, field: str, row: int) -> int:
    if field.startswith("dof_"):
        return int(model.dof_jntid[row])
    return row if field.startswith("jnt_") else int(np.flatnonzero(model.jnt_qposadr == row)[0])
