"""Names of things in a model, as robot.yaml and effects write them: `joint[elbow].damping`."""

import re
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Literal

import mujoco
import numpy as np

OBJECTS = {
    "joint": mujoco.mjtObj.mjOBJ_JOINT,
    "body": mujoco.mjtObj.mjOBJ_BODY,
    "actuator": mujoco.mjtObj.mjOBJ_ACTUATOR,
    "geom": mujoco.mjtObj.mjOBJ_GEOM,
    "sensor": mujoco.mjtObj.mjOBJ_SENSOR,
}
Place = Literal["dof", "joint", "qpos", "object"]
FIELDS: dict[str, dict[str, tuple[str, Place]]] = {
    "joint": {
        "damping": ("dof_damping", "dof"),
        "dampingpoly": ("dof_dampingpoly", "dof"),  # by |v| and by v²
        "frictionloss": ("dof_frictionloss", "dof"),
        "armature": ("dof_armature", "dof"),
        "stiffness": ("jnt_stiffness", "joint"),
        "springref": ("qpos_spring", "qpos"),
    },
    "body": {
        "mass": ("body_mass", "object"),
        "ipos": ("body_ipos", "object"),
        "inertia": ("body_inertia", "object"),
    },
    "actuator": {
        "gainprm": ("actuator_gainprm", "object"),
        "biasprm": ("actuator_biasprm", "object"),
        "dynprm": ("actuator_dynprm", "object"),
        "gear": ("actuator_gear", "object"),
        "forcerange": ("actuator_forcerange", "object"),
        "damping": ("actuator_damping", "object"),
        "armature": ("actuator_armature", "object"),
    },
    "geom": {
        "friction": ("geom_friction", "object"),
        "solref": ("geom_solref", "object"),
    },
    "option": {
        "gravity": ("opt.gravity", "object"),
        "wind": ("opt.wind", "object"),
        "density": ("opt.density", "object"),
        "viscosity": ("opt.viscosity", "object"),
    },
}
FORM = re.compile(r"(\w+)(?:\[([^\]]+)\])?\.(\w+)(?:\[(\d)\])?")
ELEMENT = {"joint": ("position", "velocity", "torque")}


@dataclass(frozen=True)
class Address:
    """Elements of one field of an MjModel: `rows`, and of each row the `column` where it has any.

    Attributes
    ----------
    mass : whether the bodies' inertias go along, as those of bodies of the same shape.
    """

    name: str
    field: str
    rows: tuple[int, ...]
    column: int | None
    unit: str = ""
    mass: bool = False

    def nominal(self, model: mujoco.MjModel) -> np.ndarray:
        """Return the values in the model, (n_rows,)."""
        return elements(field_of(model, self.field), self)


@dataclass(frozen=True)
class Channel:
    """What a column drives: the control of an actuator, or the torque (force) of a joint."""

    name: str
    actuator: int | None
    dof: int | None
    unit: str


@dataclass(frozen=True)
class Signal:
    """What a column measures."""

    name: str
    kind: Literal["position", "velocity", "sensor"]
    index: int  # of qpos, of qvel, or of sensordata
    dof: int | None
    unit: str


def field_of(model: mujoco.MjModel, field: str) -> np.ndarray:
    """Return a field of a model, those of its options as arrays too."""
    owner = model.opt if field.startswith("opt.") else model
    return np.asarray(getattr(owner, field.removeprefix("opt.")))


def elements(values: np.ndarray, at: Address) -> np.ndarray:
    """Return the addressed elements of a field (..., n, columns), (..., n_rows)."""
    if not at.rows:  # an option: one vector, or one number
        return values[..., None] if at.column is None else values[..., [at.column]]
    rows = list(at.rows)
    return values[..., rows] if at.column is None else values[..., rows, at.column]


def names_of(model: mujoco.MjModel, kind: str) -> list[str]:
    """Return the names of all objects of a kind; one without is called by its number."""
    n = {"joint": model.njnt, "body": model.nbody, "actuator": model.nu, "geom": model.ngeom}
    count = n.get(kind, model.nsensor)
    return [mujoco.mj_id2name(model, OBJECTS[kind], i) or str(i) for i in range(count)]


def address(model: mujoco.MjModel, text: str, where: str) -> Address:
    """Return what `joint[elbow].damping` or `actuator[*].gainprm[0]` stands for."""
    kind, pattern, attribute, index = _parsed(text, where)
    known = FIELDS.get(kind, {})
    if attribute not in known:
        forms = ", ".join(f"{k}.{a}" for k, some in FIELDS.items() for a in some)
        raise ValueError(f"{where}: {kind}.{attribute} cannot be set; these can: {forms}")
    field, place = known[attribute]
    values = field_of(model, field)
    if kind == "option":
        column = index if values.ndim else None
        if values.ndim and index is None:
            raise ValueError(f"{where}: it has {len(values)} elements; write {text}[0] or another")
        return Address(text, field, (), column)
    objects = matching(model, kind, pattern, where)
    rows = [row for i in objects for row in _rows(model, i, place)]
    many = values.ndim > 1
    if many and index is None:
        if attribute not in ("gainprm", "gear", "friction"):
            n = values.shape[1]
            raise ValueError(f"{where}: it has {n} elements; write {text}[0] or another")
        index = 0
    return Address(text, field, tuple(rows), index if many else None, mass=attribute == "mass")


def channel(model: mujoco.MjModel, text: str, where: str) -> Channel:
    """Return what `actuator[shoulder]` or `joint[elbow].torque` stands for."""
    kind, pattern, attribute, _ = _parsed(text if "." in text else f"{text}.ctrl", where)
    if (kind, attribute) not in (("actuator", "ctrl"), ("joint", "torque")):
        raise ValueError(f"{where}: expected actuator[NAME] or joint[NAME].torque")
    found = matching(model, kind, pattern, where)
    if len(found) > 1:
        raise ValueError(f"{where}: names {len(found)} things; a column drives one")
    if kind == "actuator":
        return Channel(text, found[0], None, "")
    dof, _, angular = _single_dof(model, found[0], where)
    return Channel(text, None, dof, "N m" if angular else "N")


def signal(model: mujoco.MjModel, text: str, where: str) -> Signal:
    """Return what `joint[elbow].position` or `sensor[tip][2]` stands for."""
    kind, pattern, attribute, index = _parsed(re.sub(r"\](\[\d\])?$", r"].value\1", text), where)
    wanted = (("joint", "position"), ("joint", "velocity"), ("sensor", "value"))
    if (kind, attribute) not in wanted:
        raise ValueError(
            f"{where}: expected joint[NAME].position, joint[NAME].velocity or sensor[NAME]"
        )
    found = matching(model, kind, pattern, where)
    if len(found) > 1:
        raise ValueError(f"{where}: names {len(found)} things; a column measures one")
    if kind == "sensor":
        size = int(model.sensor_dim[found[0]])
        if (index or 0) >= size or (index is None and size > 1):
            raise ValueError(
                f"{where}: the sensor has {size} elements; write {text.split('[')[0]}"
                f"[{pattern}][0] or another"
            )
        return Signal(text, "sensor", int(model.sensor_adr[found[0]]) + (index or 0), None, "")
    dof, qpos, angular = _single_dof(model, found[0], where)
    unit = "rad" if angular else "m"
    if attribute == "position":
        return Signal(text, "position", qpos, dof, unit)
    return Signal(text, "velocity", dof, dof, f"{unit}/s")


def _parsed(text: str, where: str) -> tuple[str, str, str, int | None]:
    match = FORM.fullmatch(str(text))
    if not match:
        raise ValueError(f"{where}: expected a name like joint[elbow].damping or actuator[*].gear")
    kind, pattern, attribute, index = match.groups()
    return kind, pattern or "", attribute, None if index is None else int(index)


def matching(model: mujoco.MjModel, kind: str, pattern: str, where: str) -> list[int]:
    """Return the objects whose names match; refuse a kind or a name that the model lacks."""
    if kind not in OBJECTS:
        raise ValueError(f"{where}: expected one of {', '.join(OBJECTS)}, option; got {kind!r}")
    names = names_of(model, kind)
    found = [i for i, name in enumerate(names) if name == pattern or fnmatchcase(name, pattern)]
    if not found:
        has = ", ".join(names) or "none"
        raise ValueError(f"{where}: the model has no {kind} {pattern!r}; it has {has}")
    return found


def _rows(model: mujoco.MjModel, i: int, place: Place) -> list[int]:
    if place == "object":
        return [i]
    if place == "joint":
        return [i]
    width = {mujoco.mjtJoint.mjJNT_FREE: 6, mujoco.mjtJoint.mjJNT_BALL: 3}
    if place == "qpos":
        return [int(model.jnt_qposadr[i])]
    first = int(model.jnt_dofadr[i])
    return list(range(first, first + width.get(mujoco.mjtJoint(model.jnt_type[i]), 1)))


def _single_dof(model: mujoco.MjModel, joint: int, where: str) -> tuple[int, int, bool]:
    kind = mujoco.mjtJoint(model.jnt_type[joint])
    if kind not in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE):
        raise ValueError(f"{where}: only hinges and slides are read; this is a free or ball joint")
    return (
        int(model.jnt_dofadr[joint]),
        int(model.jnt_qposadr[joint]),
        kind == mujoco.mjtJoint.mjJNT_HINGE,
    )


def joint_of_dof(model: mujoco.MjModel, dof: int) -> str:
    """Return the name of the joint that a degree of freedom belongs to."""
    return names_of(model, "joint")[int(model.dof_jntid[dof])]
