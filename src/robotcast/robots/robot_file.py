"""robot.yaml: which columns of the logs drive what, which measure what, and what may be tuned."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mujoco
import yaml

from robotcast.robots.couplings import couple
from robotcast.robots.names import Address, Channel, Signal, address, channel, signal
from robotcast.robots.units import to_si

FILE = "robot.yaml"
KEYS = {
    "model": "the MJCF or URDF file",
    "logs": "file names or patterns, from the folder",
    "time": "column and unit",
    "drive": "what the columns drive",
    "measured": "what the columns measure",
    "tune": "parameters of the model that the nominal fit may change, with bounds",
    "groups": "name → joints that share their effects",
    "repeats": "lists of logs that repeat one motion",
    "windows": "length_s, most",
    "exclude": "effects that are not tried",
}


@dataclass(frozen=True)
class Column:
    """One column of the logs: value × `factor` + `offset` is in SI units.

    Attributes
    ----------
    noise : standard deviation in SI units, None to have it estimated.
    """

    name: str
    factor: float
    offset: float = 0.0
    noise: float | None = None


@dataclass(frozen=True)
class Tunable:
    """Elements of the model that the nominal fit may change together.

    Attributes
    ----------
    lower, upper : bounds of the value; with `factor`, of what every element is multiplied by.
    """

    at: Address
    lower: float
    upper: float
    factor: bool


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
    tune: tuple[Tunable, ...] = ()
    groups: Mapping[str, tuple[int, ...]] = field(default_factory=dict)  # joints' dofs
    repeats: tuple[tuple[str, ...], ...] = ()
    length_s: float | None = None
    most_windows: int = 60
    exclude: tuple[str, ...] = ()


def load_spec(path: Path) -> mujoco.MjSpec:
    """Return the model of an MJCF or URDF file, or refuse it with MuJoCo's own words.

    No body is compiled as a simple one, whose centre of mass could not be moved.
    """
    if not path.is_file():
        raise ValueError(f"{path}: there is no such model; give an MJCF or URDF file")
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        for body in spec.bodies[1:]:
            body.simple = 0
        return spec
    except (ValueError, mujoco.FatalError) as error:
        raise ValueError(f"{path}: MuJoCo cannot read it: {_one_line(error)}") from None


def compiled(spec: mujoco.MjSpec, path: Path) -> mujoco.MjModel:
    """Compile a model, or refuse it with MuJoCo's own words."""
    try:
        return spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        raise ValueError(f"{path}: MuJoCo cannot compile it: {_one_line(error)}") from None


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


def read_robot(folder: Path) -> RobotFile:
    """Read FOLDER/robot.yaml.

    Raises
    ------
    ValueError
        In one sentence: file, key, rule, and what to do.
    """
    path = folder / FILE
    if not path.is_file():
        write = f"python stages/describe.py robot={folder}"
        raise ValueError(f"{folder} has no {FILE}: {write} writes one")
    try:
        said = yaml.safe_load(path.read_text(encoding="utf-8"))
    except yaml.YAMLError as error:
        raise ValueError(f"{path}: not YAML: {_one_line(error)}") from None
    said = _mapping(said, path, FILE)
    if unknown := [key for key in said if key not in KEYS]:
        raise ValueError(f"{path}: no key is called {unknown[0]!r}; there are {', '.join(KEYS)}")
    for key in ("model", "logs", "drive", "measured"):
        if not said.get(key):
            raise ValueError(f"{path}: {key!r} is missing: it names {KEYS[key]}")
    model_path = folder / str(said["model"])
    model = compiled(couple(load_spec(model_path)), model_path)
    windows = _mapping(said.get("windows") or {}, path, "windows")
    logs = _log_paths(folder, said["logs"], path)
    return RobotFile(
        path=path,
        model=model,
        model_path=model_path,
        logs=logs,
        time=_column(said.get("time") or {"column": "time"}, "s", path, "time"),
        drive=_columns(said["drive"], channel, model, path, "drive"),
        measured=_columns(said["measured"], signal, model, path, "measured"),
        tune=tuple(
            _tunable(model, name, how, path) for name, how in (said.get("tune") or {}).items()
        ),
        groups=_groups(model, said.get("groups") or {}, path),
        repeats=_repeats(said.get("repeats") or (), logs, path),
        length_s=None if windows.get("length_s") is None else float(windows["length_s"]),
        most_windows=int(windows.get("most", RobotFile.most_windows)),
        exclude=tuple(said.get("exclude") or ()),
    )


def _mapping(said: Any, path: Path, where: str) -> dict[str, Any]:
    if not isinstance(said, dict):
        raise ValueError(f"{path}: {where}: expected `key: value` lines, got {said!r}")
    return said


def _log_paths(folder: Path, said: Any, path: Path) -> tuple[Path, ...]:
    found: list[Path] = []
    for pattern in [said] if isinstance(said, str) else said:
        some = sorted(folder.glob(str(pattern)))
        if not some:
            raise ValueError(f"{path}: logs: no file matches {pattern!r} in {folder}")
        found += [one for one in some if one not in found]
    return tuple(found)


def _columns(said: Any, parse: Any, model: mujoco.MjModel, path: Path, key: str) -> dict:
    found = {}
    for target, how in _mapping(said, path, key).items():
        where = f"{key} {target}"
        at = parse(model, target, f"{path}: {where}")
        found[at] = _column(how, at.unit, path, where)
    return found


def _column(said: Any, wanted: str, path: Path, where: str) -> Column:
    """Read `NAME` or {column: NAME, unit: …, scale: …, offset: …, noise: …}, all in the unit."""
    said = {"column": said} if isinstance(said, str) else _mapping(said, path, where)
    keys = ("column", "unit", "scale", "offset", "noise", "torque_constant")
    if unknown := [key for key in said if key not in keys]:
        raise ValueError(f"{path}: {where}: no key is called {unknown[0]!r}; there are {keys}")
    if "column" not in said:
        raise ValueError(f"{path}: {where}: name the column of the logs")
    unit, constant = said.get("unit"), said.get("torque_constant")
    factor = to_si(unit, wanted, constant, f"{path}: {where}") * float(said.get("scale", 1.0))
    noise = said.get("noise")
    return Column(
        str(said["column"]),
        factor,
        factor * float(said.get("offset", 0.0)),
        None if noise is None else abs(factor) * float(noise),
    )


def _tunable(model: mujoco.MjModel, name: str, said: Any, path: Path) -> Tunable:
    at = address(model, name, f"{path}: tune {name}")
    factor = isinstance(said, dict) and set(said) == {"factor"}
    bounds = said["factor"] if factor else said
    if not isinstance(bounds, list) or len(bounds) != 2 or not bounds[0] < bounds[1]:
        raise ValueError(
            f"{path}: tune {name}: expected bounds [least, most], or factor: [least, most] of the "
            f"value in the model, got {said!r}"
        )
    return Tunable(at, float(bounds[0]), float(bounds[1]), factor)


def _groups(model: mujoco.MjModel, said: Any, path: Path) -> dict[str, tuple[int, ...]]:
    groups = {}
    for name, joints in _mapping(said, path, "groups").items():
        dofs: list[int] = []
        for joint in [joints] if isinstance(joints, str) else joints:
            at = address(model, f"joint[{joint}].damping", f"{path}: groups {name}")
            dofs += [dof for dof in at.rows if dof not in dofs]
        groups[str(name)] = tuple(dofs)
    return groups


def _repeats(said: Any, logs: Sequence[Path], path: Path) -> tuple[tuple[str, ...], ...]:
    names = {log.name for log in logs}
    for group in said:
        for name in group:
            if Path(name).name not in names:
                raise ValueError(f"{path}: repeats: {name} is none of the logs")
    return tuple(tuple(Path(name).name for name in group) for group in said)
