"""Names of things in a model, `joint[elbow].damping`, and units of columns, as robot.yaml has them.

Everything is converted to SI once, here. Below stands where joints' coordinates stand in qpos, and
how free and ball joints turn. They have one speed fewer than coordinates: a quaternion (w, x, y, z)
turns about the axes of its body. A turn by the vector v, whose length is the angle, leads from q to
q ⊗ exp(v / 2).
"""

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Literal

import mujoco
import numpy as np

OBJECTS = {
    "joint": "njnt",
    "body": "nbody",
    "actuator": "nu",
    "tendon": "ntendon",
    "geom": "ngeom",
    "sensor": "nsensor",
}


def _called_after(prefix: str, names: str) -> dict[str, str]:
    return {name: f"{prefix}{name}" for name in names.split()}


SLIDES = 2  # `body_simple` of a body that only slides: its centre of mass moves nothing
FIELDS = {  # what may be set of each: a field of MjModel, most of them called as in MJCF
    "joint": {
        "damping": "dof_damping",
        "dampingpoly": "dof_dampingpoly",  # by |v| and by v²
        "frictionloss": "dof_frictionloss",
        "armature": "dof_armature",
        "stiffness": "jnt_stiffness",
        "springref": "qpos_spring",
    },
    "body": _called_after("body_", "mass ipos inertia gravcomp"),
    "actuator": {
        "kp": "actuator_gainprm",
        **_called_after("actuator_", "gainprm biasprm dynprm gear forcerange damping armature"),
    },
    "tendon": _called_after("tendon_", "frictionloss damping stiffness"),
    "geom": _called_after("geom_", "friction solref"),
    "option": _called_after("opt.", "gravity wind density viscosity"),
}
FIRST_OF = ("kp", "gainprm", "gear", "friction")  # without an index, their first element is meant
FORM = re.compile(r"(\w+)(?:\[([^\]]+)\])?(?:\.(\w+))?(?:\[(\d)\])?")
FREE, BALL = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL)
WIDTH = {FREE: 6, BALL: 3}  # degrees of freedom; of others 1
SIGNS = {"+": 1.0, "-": -1.0}  # of tendons between joints, called shoulder+elbow
NEAR = 5  # names that are said where one is wrong
PLACE, AXES = ("x", "y", "z"), ("w", "x", "y", "z")


@dataclass(frozen=True)
class Address:
    """Elements of one field of an MjModel: `rows`, and of each row the `column` where it has any.

    What goes `along` grows by the same factor: inertias with masses, as those of bodies of the same
    shape, and with a servo's `kp` what it holds against it.
    """

    name: str
    field: str
    rows: tuple[int, ...]
    column: int | None
    along: "tuple[Address, ...]" = ()

    def nominal(self, model: mujoco.MjModel) -> np.ndarray:
        """Return the values in the model, (n_rows,)."""
        return field_of(model, self.field)[self.index]

    @property
    def index(self) -> tuple[Any, ...]:
        """Index of the elements in a field (..., n, columns), which gives (..., n_rows)."""
        rows = list(self.rows)
        if not rows:  # an option: one vector, or one number
            return ..., None if self.column is None else [self.column]
        return (..., rows) if self.column is None else (..., rows, self.column)


@dataclass(frozen=True)
class Channel:
    """What a column drives: the control of an actuator, or the torque (force) of a joint."""

    name: str
    actuator: int | None
    dof: int | None
    unit: str


@dataclass(frozen=True)
class Signal:
    """What a column measures.

    A "turn" is an element of a quaternion; its `dof` is the first of those that turn it. `element`
    says which one of a free or a ball joint is measured.
    """

    name: str
    kind: Literal["position", "velocity", "turn", "sensor"]
    index: int  # of qpos, of qvel, or of sensordata
    dof: int | None
    unit: str
    element: str = ""

    @property
    def spoken(self) -> str:
        """As it is read: elbow position."""
        kind, pattern, attribute, index = FORM.fullmatch(self.name).groups()  # type: ignore
        end = self.element or index
        return f"{pattern} {attribute or kind}{f' {end}' if end else ''}".replace("_", " ")


def field_of(model: mujoco.MjModel, field: str) -> np.ndarray:
    """Return a field of a model, those of its options as arrays too."""
    owner = model.opt if field.startswith("opt.") else model
    return np.asarray(getattr(owner, field.removeprefix("opt.")))


def names_of(model: mujoco.MjModel, kind: str) -> list[str]:
    """Return the names of all objects of a kind; one without is called by its number."""
    return [getattr(model, kind)(i).name or str(i) for i in range(getattr(model, OBJECTS[kind]))]


def inserted(model: mujoco.MjModel) -> dict[int, tuple[str, str, str]]:
    """Return the tendons that are not the file's: of which joint, with which sign, the other."""
    joints, tendons = names_of(model, "joint"), names_of(model, "tendon")
    made = {f"{a}{mark}{b}": (a, mark, b) for a in joints for b in joints for mark in SIGNS}
    return {tendon: made[name] for tendon, name in enumerate(tendons) if name in made}


def name_of_dof(model: mujoco.MjModel, dof: int) -> str:
    """Return the name of a degree of freedom: its joint's, with the axis of one that has more."""
    joint = int(model.dof_jntid[dof])
    name, after = names_of(model, "joint")[joint], dof - int(model.jnt_dofadr[joint])
    along = PLACE if model.jnt_type[joint] == FREE else ()
    about = [f"about_{axis}" for axis in PLACE]
    return f"{name}_{[*along, *about][after]}" if model.jnt_type[joint] in WIDTH else name


def joint_of_actuator(model: mujoco.MjModel, actuator: int) -> int | None:
    """Return the joint that an actuator drives, None where it drives a tendon or a site."""
    drives = int(model.actuator_trntype[actuator])  # hinges and slides are driven alike by both
    of_joint = drives in (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)
    return int(model.actuator_trnid[actuator, 0]) if of_joint else None


def driven_dof(model: mujoco.MjModel, at: Channel) -> int | None:
    """Return the degree of freedom that a channel drives, None where that is no hinge or slide."""
    if at.actuator is None:
        return at.dof
    joint = joint_of_actuator(model, at.actuator)
    single = joint is not None and model.jnt_type[joint] not in WIDTH
    return int(model.jnt_dofadr[joint]) if single else None


def is_hinge(model: mujoco.MjModel, joint: int) -> bool:
    """Tell hinges from slides."""
    return int(model.jnt_type[joint]) == int(mujoco.mjtJoint.mjJNT_HINGE)


def in_file(spec: mujoco.MjSpec, joint: Any, value: float) -> float:
    """Return a position of a joint [rad, m] as the file has it, which may be in degrees."""
    angular = joint.type == mujoco.mjtJoint.mjJNT_HINGE
    return float(np.degrees(value)) if angular and spec.compiler.degree else value


def refuse_unknown(key: str, names: Iterable[str], known: Sequence[str]) -> None:
    """Raise ValueError for a name of no effect, with those that are most like it."""
    if unknown := sorted({*names} - {*known}):
        near = get_close_matches(unknown[0], known, NEAR, cutoff=0.0)
        raise ValueError(f"{key}: no effect is called {unknown[0]}; nearest is {', '.join(near)}")


def address(model: mujoco.MjModel, text: str, where: str) -> Address:
    """Return what `joint[elbow].damping` or `actuator[*].gainprm[0]` stands for."""
    kind, pattern, attribute, index = _parsed(text, where)
    field = FIELDS.get(kind, {}).get(attribute)
    if field is None:
        forms = ", ".join(f"{k}.{a}" for k, some in FIELDS.items() for a in some)
        raise ValueError(f"{where}: {kind}.{attribute} cannot be set; these can: {forms}")
    values = field_of(model, field)
    option = kind == "option"
    found = [] if option else matching(model, kind, pattern, where)
    rows = tuple(row for i in found for row in _rows(model, i, field))
    size = values.shape[-1] if values.ndim > (0 if option else 1) else 0
    if size and index is None and attribute in FIRST_OF:
        index = 0
    if size and (index is None or index >= size):
        raise ValueError(f"{where}: it has {size} elements; end it with [0] to [{size - 1}]")
    _refuse_index(None if size else index, where)
    along: tuple[Address, ...] = ()
    if attribute == "ipos" and (model.body_simple[found] == SLIDES).any():
        raise ValueError(f"{where}: that body only slides; its centre of mass moves nothing")
    if attribute == "mass":
        along = tuple(Address(text, "body_inertia", rows, axis) for axis in range(3))
    elif attribute == "kp":
        along = (Address(text, "actuator_biasprm", rows, 1),)
        if not along[0].nominal(model).all():
            raise ValueError(f"{where}: only position servos have a kp; take gainprm")
    return Address(text, field, rows, index if size else None, along=along)


def channel(model: mujoco.MjModel, text: str, where: str) -> Channel:
    """Return what `actuator[shoulder]` or `joint[elbow].torque` stands for."""
    kind, pattern, attribute, index = _parsed(text, where)
    if (kind, attribute) not in (("actuator", ""), ("joint", "torque")):
        raise ValueError(f"{where}: expected actuator[NAME] or joint[NAME].torque")
    _refuse_index(index, where)
    one = _single(model, kind, pattern, where, "drives")
    if kind == "actuator":
        return Channel(text, one, None, "")
    if model.jnt_type[one] in WIDTH:
        raise ValueError(f"{where}: no column drives a free or a ball joint; take an actuator")
    return Channel(text, None, int(model.jnt_dofadr[one]), "N m" if is_hinge(model, one) else "N")


def signal(model: mujoco.MjModel, text: str, where: str) -> Signal:
    """Return what `joint[elbow].position` or `sensor[tip][2]` stands for."""
    kind, pattern, attribute, index = _parsed(text, where)
    if (kind, attribute) not in (("joint", "position"), ("joint", "velocity"), ("sensor", "")):
        raise ValueError(
            f"{where}: expected joint[NAME].position, joint[NAME].velocity or sensor[NAME]"
        )
    one = _single(model, kind, pattern, where, "measures")
    if kind == "sensor":
        size = int(model.sensor_dim[one])
        if (index or 0) >= size or (index is None and size > 1):
            raise ValueError(
                f"{where}: the sensor has {size} elements; write sensor[{pattern}][0] or another"
            )
        return Signal(text, "sensor", int(model.sensor_adr[one]) + (index or 0), None, "")
    dof, unit = int(model.jnt_dofadr[one]), "rad" if is_hinge(model, one) else "m"
    if model.jnt_type[one] in WIDTH:
        return _loose_signal(model, one, text, attribute, index, where)
    _refuse_index(index, where)
    if attribute == "position":
        return Signal(text, "position", int(model.jnt_qposadr[one]), dof, unit)
    return Signal(text, "velocity", dof, dof, f"{unit}/s")


def _refuse_index(index: int | None, where: str) -> None:
    if index is not None:
        raise ValueError(f"{where}: it is one number; leave [{index}] out")


def _loose_signal(
    model: mujoco.MjModel, joint: int, text: str, attribute: str, index: int | None, where: str
) -> Signal:
    """Return an element of a free or a ball joint's position or velocity."""
    place = PLACE if model.jnt_type[joint] == FREE else ()
    ends = [*place, *(AXES if attribute == "position" else PLACE)]
    if index is None or index >= len(ends):
        what = "x y z [m], then the quaternion w x y z"
        what = what if attribute == "position" else "x y z [m/s], then about x y z [rad/s]"
        what = what if place else what.partition("then ")[2]
        raise ValueError(f"{where}: end it with [0] to [{len(ends) - 1}]: {what}")
    straight, dof = index < len(place), int(model.jnt_dofadr[joint])
    if attribute == "velocity":
        end = ends[index] if straight else f"about {ends[index]}"
        unit = "m/s" if straight else "rad/s"
        return Signal(text, "velocity", dof + index, dof + index, unit, end)
    at = int(model.jnt_qposadr[joint]) + index
    if straight:
        return Signal(text, "position", at, dof + index, "m", ends[index])
    return Signal(text, "turn", at, dof + len(place), "", f"q{ends[index]}")


def matching(model: mujoco.MjModel, kind: str, pattern: str, where: str) -> list[int]:
    """Return the objects whose names match; refuse a kind or a name that the model lacks."""
    if kind not in OBJECTS:
        raise ValueError(f"{where}: expected one of {', '.join(OBJECTS)}, option; got {kind!r}")
    names = names_of(model, kind)
    found = [i for i, name in enumerate(names) if name == pattern or fnmatchcase(name, pattern)]
    hidden = inserted(model) if kind == "tendon" and pattern not in names else {}
    found = [i for i in found if i not in hidden]
    if not found:
        has = ", ".join(names) or "none"
        raise ValueError(f"{where}: the model has no {kind} {pattern!r}; it has {has}")
    return found


def _parsed(text: str, where: str) -> tuple[str, str, str, int | None]:
    match = FORM.fullmatch(str(text))
    if not match:
        raise ValueError(f"{where}: expected a name like joint[elbow].damping or actuator[*].gear")
    kind, pattern, attribute, index = match.groups()
    return kind, pattern or "", attribute or "", None if index is None else int(index)


def _single(model: mujoco.MjModel, kind: str, pattern: str, where: str, does: str) -> int:
    found = matching(model, kind, pattern, where)
    if len(found) > 1:
        raise ValueError(f"{where}: names {len(found)} things; a column {does} one")
    return found[0]


def _rows(model: mujoco.MjModel, i: int, field: str) -> list[int]:
    if field.startswith("qpos_"):
        return [int(model.jnt_qposadr[i])]
    if not field.startswith("dof_"):
        return [i]
    first = int(model.jnt_dofadr[i])
    return list(range(first, first + WIDTH.get(int(model.jnt_type[i]), 1)))


def counted(path: Path) -> str:
    """Return what paths are sorted by, so that log2 comes before log10."""
    return re.sub(r"\d+", lambda number: number[0].zfill(9), path.as_posix())


def loose(model: Any) -> np.ndarray:
    """Tell which degrees of freedom, (nv,), are those of free and of ball joints."""
    return np.isin(model.jnt_type[model.dof_jntid], (FREE, BALL))


def turning(model: Any) -> np.ndarray:
    """Tell which degrees of freedom, (nv,), turn a quaternion."""
    kind, first = model.jnt_type[model.dof_jntid], model.jnt_dofadr[model.dof_jntid]
    return (kind == BALL) | ((kind == FREE) & (np.arange(model.nv) - first >= 3))


def coordinates(model: Any) -> np.ndarray:
    """Return where in qpos each degree of freedom moves, (nv,).

    Of a turn it is the element of the quaternion that grows by half of the angle from rest.
    """
    after = np.arange(model.nv) - model.jnt_dofadr[model.dof_jntid]
    return model.jnt_qposadr[model.dof_jntid] + after + turning(model)


def quaternions(model: Any) -> list[tuple[int, int]]:
    """Return where in qpos each quaternion begins, and which is the first dof that turns it."""
    return [
        (int(q) + 3 * (kind == FREE), int(dof) + 3 * (kind == FREE))
        for kind, q, dof in zip(model.jnt_type, model.jnt_qposadr, model.jnt_dofadr, strict=True)
        if kind in (FREE, BALL)
    ]


def moved(model: Any, qpos: np.ndarray, by: np.ndarray) -> np.ndarray:
    """Return positions (n, nq) moved by (n, nv)."""
    found, straight = qpos.copy(), ~turning(model)
    found[:, coordinates(model)[straight]] += by[:, straight]
    for at, dof in quaternions(model):
        found[:, at : at + 4] = turned(qpos[:, at : at + 4], by[:, dof : dof + 3])
    return found


def rates(model: Any, qpos: np.ndarray, step_s: float) -> np.ndarray:
    """Return the velocities (n_sim, n, nv) of positions (n_sim, n, nq) at equal steps."""
    found = np.gradient(qpos[:, :, coordinates(model)], step_s, axis=1)
    for at, dof in quaternions(model):
        q = qpos[:, :, at : at + 4]
        found[:, :, dof : dof + 3] = 2 * _relative(q, np.gradient(q, step_s, axis=1))[..., 1:]
    return found


def turned(q: np.ndarray, by: np.ndarray) -> np.ndarray:
    """Return quaternions (…, 4) turned by vectors (…, 3) in their own axes."""
    half = np.linalg.norm(by, axis=-1, keepdims=True) / 2
    vector = by / 2 * np.sinc(half / np.pi)
    w, v = q[..., :1], q[..., 1:]
    real = w * np.cos(half) - (v * vector).sum(axis=-1, keepdims=True)
    return np.concatenate([real, w * vector + v * np.cos(half) + np.cross(v, vector)], axis=-1)


def turn(q: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the vectors (…, 3) by which quaternions (…, 4) are turned to others, the short way."""
    between = _relative(q, other)
    between = between * np.where(between[..., :1] < 0, -1.0, 1.0)
    sine = np.linalg.norm(between[..., 1:], axis=-1, keepdims=True)
    half = np.arctan2(sine, between[..., :1])
    return 2 * between[..., 1:] * half / np.where(sine > 0, sine, 1.0)


def spin(by: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Return the angular velocity (…, 3) where a turn `by` a small vector changes at a rate."""
    across = np.cross(by, rate)
    return rate - across / 2 + np.cross(by, across) / 6


def rate_of_turn(by: np.ndarray, spinning: np.ndarray) -> np.ndarray:
    """Return the rate at which a turn `by` a small vector changes, by the angular velocity."""
    across = np.cross(by, spinning)
    return spinning + across / 2 + np.cross(by, across) / 12


def _relative(q: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return q⁻¹ ⊗ other."""
    w, v, w2, v2 = q[..., :1], q[..., 1:], other[..., :1], other[..., 1:]
    real = w * w2 + (v * v2).sum(axis=-1, keepdims=True)
    return np.concatenate([real, w * v2 - w2 * v - np.cross(v, v2)], axis=-1)


ANGLE = {"rad": 1.0, "deg": math.pi / 180, "mrad": 1e-3, "rev": 2 * math.pi}
LENGTH = {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "um": 1e-6}
UNITS = {
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "rad": ANGLE,
    "m": LENGTH,
    "rad/s": {**{f"{u}/s": f for u, f in ANGLE.items()}, "rpm": 2 * math.pi / 60},
    "m/s": {f"{u}/s": f for u, f in LENGTH.items()},
    "N m": {"N m": 1.0, "Nm": 1.0, "mN m": 1e-3, "mNm": 1e-3},
    "N": {"N": 1.0, "mN": 1e-3, "kN": 1e3},
}
CURRENT = {"A": 1.0, "mA": 1e-3}


def to_si(unit: str | None, wanted: str, torque_constant: float | None, where: str) -> float:
    """Return what a value in `unit` is multiplied by to be in the SI unit `wanted`.

    A current is one of torque through the `torque_constant` [N m/A]. An empty `wanted`, of
    controls and sensors, takes any of the units.
    """
    if torque_constant is not None or unit in CURRENT:
        if unit not in CURRENT or torque_constant is None:
            raise ValueError(f"{where}: a current needs unit A or mA and a torque_constant [N m/A]")
        return CURRENT[unit] * float(torque_constant)
    if unit is None:
        return 1.0
    known = UNITS.get(wanted) or {u: f for some in UNITS.values() for u, f in some.items()}
    if unit not in known:
        raise ValueError(
            f"{where}: the unit {unit!r} is none of {', '.join(known)}; for another one give "
            f"scale: what a value is multiplied by to be in {wanted or 'the unit of the model'}"
        )
    return known[unit]
