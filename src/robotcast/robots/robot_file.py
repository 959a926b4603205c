"""robot.yaml: which columns of the logs drive what, which measure what, and what may be tuned.

Last, the ParameterDict of `mujoco.sysid` as it stands on disk, a YAML file of plain numbers.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from robotcast.files import read_mapping, write_yaml
from robotcast.robots.closure import Followers
from robotcast.robots.couplings import WORLD, couple, find_meshes, moved_by, serve
from robotcast.robots.model_fields import Payload
from robotcast.robots.names import (
    WIDTH,
    Address,
    Channel,
    Signal,
    address,
    channel,
    counted,
    matching,
    names_of,
    signal,
    to_si,
)

FILE = "robot.yaml"
NEEDED = {
    "model": "the MJCF or URDF file",
    "logs": "file names or patterns, from the folder",
    "measured": "what the columns measure",
}
KEYS = """model logs time drive measured servos weld tune sysid groups payloads repeats windows
exclude factors"""
MOST_WINDOWS = 60
COLUMN_KEYS = ("column", "unit", "scale", "offset", "noise", "torque_constant")


@dataclass(frozen=True)
class Column:
    """One column of the logs: value × `factor` + `offset` is in SI units."""

    name: str
    factor: float
    offset: float = 0.0
    noise: float | None = None  # standard deviation in SI units, None to have it estimated
    unit: str = ""  # as the log has it; empty where robot.yaml gives none


@dataclass(frozen=True)
class Tunable:
    """Elements of the model that the nominal fit may change together."""

    at: Address
    # bounds of the value; with `factor`, of what every element is multiplied by
    lower: float
    upper: float
    factor: bool
    start: float | None = None  # where a fit starts; None for what the model has
    frozen: bool = False  # whether it stays there


@dataclass(frozen=True)
class RobotFile:
    """What robot.yaml says, checked against the model."""

    path: Path
    model: mujoco.MjModel
    model_path: Path
    logs: tuple[Path, ...]
    time: Column
    drive: Mapping[Channel, Column]
    measured: Mapping[Signal, Column]
    followers: Followers
    weld: tuple[str, ...]
    servos: Mapping[str, tuple[float, float]]
    tune: tuple[Tunable, ...]
    groups: Mapping[str, tuple[int, ...]]  # joints' dofs
    payloads: Mapping[str, tuple[Payload, ...]]  # by log
    repeats: tuple[tuple[str, ...], ...]
    factors: Mapping[str, Column]  # what else may matter, such as a temperature
    length_s: float | None
    most_windows: int
    exclude: tuple[str, ...]


def load_spec(path: Path, weld: Sequence[str] = ()) -> mujoco.MjSpec:
    """Return the model of an MJCF or URDF file, or refuse it with MuJoCo's own words.

    What turns is never compiled as a simple body, whose centre of mass could not be moved. Welded
    joints are left out, with their actuators, sensors, and the keyframes. Bodies that a joint links
    do not collide, but for those on what is welded to the world; a base on a stand keeps the rule.
    """
    if not path.is_file():
        raise ValueError(f"{path}: there is no such model; give an MJCF or URDF file")
    try:
        spec = mujoco.MjSpec.from_file(str(path))
    except (ValueError, mujoco.FatalError) as error:
        raise ValueError(f"{path}: MuJoCo cannot read it: {_one_line(error)}") from None
    find_meshes(spec, path)
    for joint in spec.joints:
        if joint.type != mujoco.mjtJoint.mjJNT_SLIDE:
            joint.parent.simple = 0
    if unknown := [name for name in weld if name not in called(spec.joints)]:
        has = ", ".join(called(spec.joints))
        raise ValueError(f"{path}: weld: the model has no joint {unknown[0]!r}; it has {has}")
    moving = Moving(spec, weld)
    linked = _linked(spec) if weld else []
    some = [*spec.sensors, *spec.actuators, *spec.joints]
    kept = [*moving.sensors, *moving.actuators, *moving.joints]
    for one in [one for one in some if not any(one is k for k in kept)]:
        spec.delete(one)
    for key in list(spec.keys) if weld else ():
        spec.delete(key)
    for body, other in linked:
        if moved_by(body).name == WORLD:
            spec.add_exclude(bodyname1=body.name, bodyname2=other.name)
    return spec


def _linked(spec: mujoco.MjSpec) -> list[tuple[Any, Any]]:
    """Return the pairs of bodies that a joint links, each with what is fixed to it; name them."""
    if spec.option.disableflags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT:
        return []
    taken = {body.name for body in spec.bodies}
    for k, body in enumerate(spec.bodies):
        body.name = body.name or (f"{k}_" if str(k) in taken else str(k))
    bodies = [body for body in spec.bodies if moved_by(body).name != WORLD]
    above = {body.name: moved_by(moved_by(body).parent).name for body in bodies}
    return [(a, b) for a in bodies for b in bodies if moved_by(a).name == above[b.name]]


def called(elements: Iterable[Any]) -> list[str]:
    """Return the names of a spec's elements; one without is called by its number."""
    return [one.name or str(k) for k, one in enumerate(elements)]


class Moving:
    """A spec without its welded joints, their actuators and their sensors; else as it is."""

    def __init__(self, spec: mujoco.MjSpec, weld: Sequence[str]) -> None:
        joints = zip(spec.joints, called(spec.joints), strict=True)
        gone = {mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT}
        self._spec = spec
        self.joints = [joint for joint, name in joints if name not in weld]
        self.actuators = [
            a for a in spec.actuators if a.trntype not in gone or a.target not in weld
        ]
        driven = {a.name for a in spec.actuators} - {a.name for a in self.actuators}
        self.sensors = [s for s in spec.sensors if s.objname not in {*weld, *driven}]

    def __getattr__(self, name: str) -> Any:
        return getattr(self._spec, name)


def compiled(spec: mujoco.MjSpec, path: Path, weld: Sequence[str] = ()) -> mujoco.MjModel:
    """Compile a model, without welded joints, or refuse it with MuJoCo's own words."""
    try:
        model = spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        said = _one_line(error)
        without = f" without {', '.join(weld)}, which weld leaves out" if weld else ""
        copy = "; copy its meshes along, at the places that it names" if "file" in said else ""
        raise ValueError(f"{path}: MuJoCo cannot compile it{without}: {said}{copy}") from None
    for name in _held_by_mocap(model):
        raise ValueError(
            f"{path}: an equality holds the robot to the mocap body {name}, which no log can move; "
            "take the equality out of the model"
        )
    return model


def _held_by_mocap(model: mujoco.MjModel) -> Iterator[str]:
    """Yield the names of mocap bodies to which an equality holds something."""
    ids, acts = np.stack([model.eq_obj1id, model.eq_obj2id], axis=1), model.eq_active0.astype(bool)
    bodies = acts & (model.eq_objtype == mujoco.mjtObj.mjOBJ_BODY)
    sites = acts & (model.eq_objtype == mujoco.mjtObj.mjOBJ_SITE)
    held = [*ids[bodies].ravel(), *model.site_bodyid[ids[sites].ravel()]]
    yield from (model.body(b).name or str(b) for b in held if model.body_mocapid[b] >= 0)


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


def read_robot(folder: Path) -> RobotFile:
    """Read FOLDER/robot.yaml, or refuse it in one sentence (ValueError).

    That says file, key, rule, and what to do.
    """
    path = folder / FILE
    if not path.is_file():
        write = f"python stages/describe.py robot={folder}"
        raise ValueError(f"{folder} has no {FILE}: {write} writes one")
    said = _Said(path, "", read_mapping(path, "`key: value` lines"))
    said.allow(*KEYS.split())
    for key, what in NEEDED.items():
        if not said.get(key):
            raise ValueError(f"{path}: {key!r} is missing: it names {what}")
    model_path, weld = folder / str(said.get("model")), tuple(said.names("weld"))
    servos = _servos(said.part("servos"))
    spec = couple(load_spec(model_path, weld))
    serve(spec, servos, f"{path}: servos")
    model = compiled(spec, model_path, weld)
    measured = _columns(said.part("measured"), signal, model)
    followers = Followers(model, {at.index for at in measured if at.kind in ("position", "turn")})
    for joint, element in followers.lacking.items():
        name = names_of(model, "joint")[joint]
        at = f"[{element}]" if model.jnt_type[joint] in WIDTH else ""
        raise ValueError(
            f"{path}: no column measures joint[{name}].position{at}, so that nobody knows from "
            f"where a window starts; measure it, or say weld: [{name}] if it does not move"
        )
    if model.nu and "drive" not in said.values:
        what = "it names what the columns drive; if nothing does, say drive: {}"
        raise ValueError(f"{path}: 'drive' is missing: {what}")
    known = read_parameters(folder / str(said.get("sysid"))) if said.get("sysid") else {}
    logs, windows, factors = _log_paths(folder, said), said.part("windows"), said.part("factors")
    windows.allow("length_s", "most")
    for key in windows.values:
        if (number := windows.number(key)) is not None and number <= 0:
            raise windows.wrong("expected a number above 0", number, key)
    return RobotFile(
        path=path,
        model=model,
        model_path=model_path,
        logs=logs,
        time=_column(said.part("time", "column", "time"), "s"),
        drive=_columns(said.part("drive"), channel, model),
        measured=measured,
        followers=followers,
        weld=weld,
        servos=servos,
        tune=tuple(_tunables(said, known, model)),
        groups=_groups(said.part("groups"), model),
        payloads=_payloads(said.part("payloads"), model),
        repeats=_repeats(said),
        factors={str(k): _column(factors.part(k, "column"), "") for k in factors.values},
        length_s=windows.number("length_s"),
        most_windows=int(windows.number("most") or MOST_WINDOWS),
        exclude=tuple(said.names("exclude")),
    )


@dataclass(frozen=True)
class _Said:
    """A mapping of robot.yaml, which knows where it stands."""

    path: Path
    where: str
    values: Any

    def __post_init__(self) -> None:
        if not isinstance(self.values, dict):
            raise self.wrong("expected `key: value` lines", self.values)

    def at(self, key: Any = "") -> str:
        """Return where it stands, or the value of a key in it."""
        return f"{self.path}: {f'{self.where} {key}'.strip()}".rstrip(": ")

    def wrong(self, rule: str, got: Any, key: Any = "") -> ValueError:
        """Return the error that a rule was broken there."""
        return ValueError(f"{self.at(key)}: {rule}, got {got!r}")

    def allow(self, *keys: str) -> None:
        """Refuse any other key."""
        if unknown := [key for key in self.values if key not in keys]:
            there = ", ".join(keys)
            raise ValueError(f"{self.at()}: no key is called {unknown[0]!r}; there are {there}")

    def get(self, key: Any) -> Any:
        return self.values.get(key)

    def part(self, key: Any, short: str = "", otherwise: Any = None) -> "_Said":
        """Return a mapping below; what stands there alone is its `short` key."""
        value = self.values.get(key, otherwise)
        if short and not isinstance(value, dict):
            value = {short: value}
        return _Said(self.path, f"{self.where} {key}".strip(), {} if value is None else value)

    def names(self, key: str) -> list[str]:
        """Return a list of names, or one; a name may be a number."""
        given = self.get(key)
        some = given if isinstance(given, list) else [] if given is None else [given]
        if any(isinstance(one, bool) or not isinstance(one, str | int) for one in some):
            raise self.wrong("expected names", given, key)
        return [str(one) for one in some]

    def number(self, key: str) -> float | None:
        """Return a number, None where it is not given."""
        value = self.get(key)
        if isinstance(value, str):  # to YAML 1.0e5 is a word
            with suppress(ValueError):
                value = float(value)
        known = value is None or (isinstance(value, int | float) and math.isfinite(value))
        if isinstance(value, bool) or not known:
            raise self.wrong("expected a number", value, key)
        return None if value is None else float(value)


def _log_paths(folder: Path, said: _Said) -> tuple[Path, ...]:
    found: list[Path] = []
    for pattern in said.names("logs"):
        some = sorted(folder.glob(pattern), key=counted)
        found += some
        if not some:
            raise ValueError(f"{said.at('logs')}: no file matches {pattern!r} in {folder}")
    return tuple(dict.fromkeys(found))


def _columns(said: _Said, parse: Callable[..., Any], model: mujoco.MjModel) -> dict:
    found = {}
    for target in said.values:
        at = parse(model, target, said.at(target))
        found[at] = _column(said.part(target, "column"), at.unit)
    return found


def _column(said: _Said, wanted: str) -> Column:
    """Read {column: NAME, unit: …, scale: …, offset: …, noise: …}, all numbers in the unit."""
    said.allow(*COLUMN_KEYS)
    if not isinstance(said.get("column"), str | int | float):
        raise said.wrong("name the column of the logs", said.get("column"))
    unit, constant = said.get("unit"), said.number("torque_constant")
    factor = to_si(unit, wanted, constant, said.at())
    factor *= 1.0 if (scale := said.number("scale")) is None else scale
    noise = said.number("noise")
    noise = None if noise is None else abs(factor) * noise
    shown = "" if unit is None or said.get("scale") is not None else str(unit)
    offset = factor * (said.number("offset") or 0.0)
    return Column(str(said.get("column")), factor, offset, noise, shown)


def _tunables(said: _Said, known: Mapping[str, Mapping[str, Any]], model: Any) -> list[Tunable]:
    """Read `tune`; a word in the place of bounds names a parameter of the ParameterDict."""
    found, part = [], said.part("tune")
    for name, how in (part.values or {name: name for name in known}).items():
        at = address(model, name, part.at(name))
        if isinstance(how, str) and how in known:
            found.append(Tunable(at, factor=False, **known[how]))
            continue
        factor = isinstance(how, dict) and set(how) == {"factor"}
        bounds = how["factor"] if isinstance(how, dict) and factor else how
        numbers = isinstance(bounds, list) and [isinstance(b, int | float) for b in bounds]
        if numbers != [True, True] or not bounds[0] < bounds[1]:
            also = f", or one of {', '.join(known)} of {said.get('sysid')}" if known else ""
            rule = f"expected bounds [least, most], or factor: [least, most] of the model's{also}"
            raise part.wrong(rule, how, name)
        found.append(Tunable(at, float(bounds[0]), float(bounds[1]), factor))
    return found


def _servos(said: _Said) -> dict[str, tuple[float, float]]:
    found = {}
    for target in said.values:
        part = said.part(target)
        part.allow("kp", "kd")
        kp, kd = part.number("kp"), part.number("kd")
        if kp is None or kd is None or not (kp > 0 and kd >= 0):
            gains = "the gains with which the robot follows a position [N m/rad, N m s/rad]"
            raise part.wrong(f"expected {{kp: …, kd: …}}, {gains}", part.values)
        found[str(target)] = kp, kd
    return found


def _groups(said: _Said, model: mujoco.MjModel) -> dict[str, tuple[int, ...]]:
    groups = {}
    for name in said.values:
        patterns, where = said.names(name), said.at(name)
        found = [j for one in patterns for j in matching(model, "joint", one, where)]
        if any(model.jnt_type[j] in WIDTH for j in found):
            raise said.wrong("only hinges and slides share their effects", patterns, name)
        groups[str(name)] = tuple(dict.fromkeys(int(model.jnt_dofadr[j]) for j in found))
    return groups


def _payloads(said: _Said, model: mujoco.MjModel) -> dict[str, tuple[Payload, ...]]:
    """Read body → log → mass, or {kg: mass, at: place in the body's frame}."""
    found: dict[str, tuple[Payload, ...]] = {}
    for target in said.values:
        part = said.part(target)
        name = str(target).removeprefix("body[").removesuffix("]")
        body = matching(model, "body", name, part.at())[0]
        for log in part.values:
            given = part.part(log, "kg")
            given.allow("kg", "at")
            mass_kg, place = given.number("kg"), given.get("at") or model.body_ipos[body].tolist()
            numbers = isinstance(place, list) and [isinstance(x, int | float) for x in place]
            if mass_kg is None or mass_kg < 0 or numbers != [True, True, True]:
                raise given.wrong("expected a mass [kg], or {kg: …, at: [x, y, z]}", given.values)
            x, y, z = map(float, place)
            found[str(log)] = (*found.get(str(log), ()), Payload(body, mass_kg, (x, y, z)))
    return found


def _repeats(said: _Said) -> tuple[tuple[str, ...], ...]:
    groups = said.get("repeats") or []
    if not isinstance(groups, list) or not all(isinstance(group, list) for group in groups):
        raise said.wrong("expected lists of logs", groups, "repeats")
    return tuple(tuple(map(str, group)) for group in groups)


def read_parameters(path: Path) -> dict[str, dict[str, Any]]:
    """Return name → `lower`, `upper`, `start` and `frozen` of every parameter of one number.

    The value that was identified is where a fit starts.
    """
    if not path.is_file():
        raise ValueError(f"{path}: there is no such file; ParameterDict.save_to_disk writes it")
    found, parameters = {}, read_mapping(path, "parameters")
    try:
        for name, one in parameters.items():
            if len(one["value"]) == 1:
                lower, upper, start = (one[k][0] for k in ("min_value", "max_value", "value"))
                numbers = {"lower": float(lower), "upper": float(upper), "start": float(start)}
                found[name] = {**numbers, "frozen": bool(one["frozen"])}
    except (LookupError, TypeError, ValueError):
        raise ValueError(f"{path}: not a ParameterDict of mujoco.sysid") from None
    return found


def write_parameters(path: Path, sizes: Mapping[str, Mapping[str, Any]]) -> None:
    """Write fitted parameters, `model.parameters` of diagnosis.json, as a ParameterDict.

    Bounds are the ends of their intervals; one without an interval is frozen.
    """
    said = {}
    for name, size in sizes.items():
        value = float(size["value"])
        low, high = (value if size.get(k) is None else float(size[k]) for k in ("low", "high"))
        said[name] = {"name": name, "nominal": [value]}
        said[name] |= {"min_value": [min(low, value)], "max_value": [max(high, value)]}
        said[name] |= {"value": [value], "frozen": low == high}
    write_yaml(path, said)
