"""A first robot.yaml, guessed from the names in a model and in the header of a log."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np
import polars as pl

from robotcast.files import write_text
from robotcast.robots.logs import columns_of
from robotcast.robots.names import names_of
from robotcast.robots.robot_file import FILE, compiled, load_spec

TIMES = ("time", "t", "timestamp", "stamp", "time_s", "t_s", "sec", "seconds", "time_ms")
WORDS = {
    "command": "u ctrl control command commanded cmd con des desired target action ref setpoint",
    "torque": "tau torque torques effort efforts current currents",
    "velocity": "v dq qd dqpos vel velocity velocities qvel speed omega rate rpm",
    "position": "q pos position positions angle angles theta qpos deg",
}
KINDS = {kind: set(words.split()) for kind, words in WORDS.items()}
FAR_RAD, FAST_RAD_S = 13.0, 150.0  # beyond these a hinge is taken to be logged in degrees
TUNE = """# tune:  # parameters that the nominal fit may change, with bounds; the others are trusted
#   joint[{joint}].damping: [0.0, 1.0]
#   body[*].mass: {{ factor: [0.8, 1.2] }}
"""


@dataclass
class Guess:
    """What robot.yaml will say, and what was guessed in a sentence each."""

    time: str = ""
    time_unit: str = "s"
    drive: dict[str, tuple[str, str]] = field(default_factory=dict)  # target → column, unit
    measured: dict[str, tuple[str, str]] = field(default_factory=dict)
    unused: list[str] = field(default_factory=list)


def describe(folder: Path) -> tuple[Path, list[str]]:
    """Write FOLDER/robot.yaml; return it and what is to be looked at, a sentence each."""
    path = folder / FILE
    if path.exists():
        raise ValueError(f"{path} exists already: rename it, or edit it")
    model_path = _only(folder, ("*.xml", "*.urdf"), "an MJCF or URDF file")
    logs = sorted(p for e in ("csv", "parquet") for p in folder.rglob(f"*.{e}"))
    if not logs:
        raise ValueError(f"{folder}: no log (.csv or .parquet) lies in it")
    model = compiled(load_spec(model_path), model_path)
    table = columns_of(logs[0])
    numbers = [c for c in table.columns if table[c].dtype.is_numeric()]
    guess = _guessed(model, table, numbers)
    write_text(path, _text(folder, model, model_path, logs, guess))
    return path, _remarks(model, logs[0], guess)


def _only(folder: Path, patterns: Sequence[str], what: str) -> Path:
    found = sorted(p for pattern in patterns for p in folder.glob(pattern))
    if len(found) > 1:
        scenes = [p for p in found if p.stem == "scene"]
        found = scenes or found
    if len(found) != 1:
        names = ", ".join(p.name for p in found) or "none"
        raise ValueError(f"{folder}: expected {what}, one; found {names}")
    return found[0]


def _guessed(model: mujoco.MjModel, table: pl.DataFrame, columns: Sequence[str]) -> Guess:
    guess = Guess()
    times = [c for c in columns if c.lower() in TIMES] or [
        c for c in columns if "time" in c.lower()
    ]
    guess.time = times[0] if times else columns[0]
    guess.time_unit = _time_unit(table[guess.time])
    left = [c for c in columns if c != guess.time]
    by_kind = {kind: [c for c in left if _kind(c) == kind] for kind in WORDS}
    joints = [n for n, t in zip(names_of(model, "joint"), model.jnt_type, strict=True) if t >= 2]
    hinges = {n: model.joint(n).type[0] == 3 for n in joints if n}
    for kind in ("position", "velocity"):
        for joint, column in _assigned(by_kind[kind], joints).items():
            unit = _unit(table[column], column, kind, hinges.get(joint, True))
            guess.measured[f"joint[{joint}].{kind}"] = (column, unit)
    actuators = names_of(model, "actuator")
    moved = [_joint_of(model, a) for a in range(model.nu)]
    found = _assigned(by_kind["command"], actuators, moved)
    guess.drive = {f"actuator[{a}]": (column, "") for a, column in found.items()}
    if not guess.drive:
        commanded = [c for c in by_kind["torque"] if _tokens(c) & KINDS["command"]]
        some = commanded or by_kind["torque"]
        guess.drive = {
            f"joint[{j}].torque": (column, "N m" if hinges.get(j, True) else "N")
            for j, column in _assigned(some, joints).items()
        }
    used = {column for column, _ in (*guess.drive.values(), *guess.measured.values())}
    guess.unused = [c for c in left if c not in used]
    return guess


def _tokens(name: str) -> set[str]:
    apart = re.sub(r"([a-z])([A-Z0-9])", r"\1 \2", name)
    return {token.lower() for token in re.split(r"[^A-Za-z0-9]+", apart) if token}


def _kind(column: str) -> str | None:
    """Return what a column seems to hold; a commanded torque is a torque."""
    tokens = _tokens(column)
    order = ("torque", "command", "velocity", "position")
    return next((kind for kind in order if tokens & KINDS[kind]), None)


def _assigned(
    columns: Sequence[str], names: Sequence[str], others: Sequence[str] = ()
) -> dict[str, str]:
    """Match columns to things by name, else in their order where there are as many of both."""
    found = {}
    for k, name in enumerate(names):
        called = [name, *others[k : k + 1]]
        same = [c for c in columns if any(n and _tokens(n) <= _tokens(c) for n in called)]
        if len(same) >= 1:
            found[name] = same[0]
    if not found and len(columns) >= len(names):
        found = dict(zip(names, columns, strict=False))
    return found


def _joint_of(model: mujoco.MjModel, actuator: int) -> str:
    if model.actuator_trntype[actuator] != int(mujoco.mjtTrn.mjTRN_JOINT):
        return ""
    return names_of(model, "joint")[int(model.actuator_trnid[actuator, 0])]


def _time_unit(times: pl.Series) -> str:
    step = float(np.median(np.diff(times.drop_nulls().to_numpy().astype(float))))
    bounds = (("ns", 2e4), ("us", 200.0), ("ms", 0.3))
    return next((unit for unit, least in bounds if step >= least), "s")


def _unit(values: pl.Series, column: str, kind: str, hinge: bool) -> str:
    tokens, known = _tokens(column), values.drop_nulls().to_numpy().astype(float)
    most = float(np.abs(known[np.isfinite(known)]).max(initial=0.0))
    if not hinge:
        return "m" if kind == "position" else "m/s"
    if "rpm" in tokens:
        return "rpm"
    if kind == "position":
        return "deg" if "deg" in tokens or most > FAR_RAD else "rad"
    return "deg/s" if "deg" in tokens or most > FAST_RAD_S else "rad/s"


def _text(
    folder: Path, model: mujoco.MjModel, model_path: Path, logs: Sequence[Path], guess: Guess
) -> str:
    parents = {log.parent for log in logs}
    patterns = sorted({f"{p.relative_to(folder)}/*".removeprefix("./") for p in parents})
    kinds = sorted({log.suffix for log in logs})
    named = [f"{pattern}{kind}" for pattern in patterns for kind in kinds]

    def lines(said: Mapping[str, tuple[str, str]]) -> str:
        rows = [
            f"  {target}: {{ column: {_quoted(column)}{f', unit: {unit}' if unit else ''} }}"
            for target, (column, unit) in said.items()
        ]
        return "\n".join(rows) or "  # nothing was recognised: add lines like those in docs"

    joint = names_of(model, "joint")[0] if model.njnt else "NAME"
    return (
        f"# Written by describe from {model_path.name} and {logs[0].name}: check columns, units.\n"
        f"model: {model_path.name}\n"
        f"logs: [{', '.join(map(_quoted, named))}]\n"
        f"time: {{ column: {_quoted(guess.time)}, unit: {guess.time_unit} }}\n"
        f"drive:  # what was commanded\n{lines(guess.drive)}\n"
        f"measured:\n{lines(guess.measured)}\n"
        f"{TUNE.format(joint=joint)}"
        + (f"# not used: {', '.join(guess.unused)}\n" if guess.unused else "")
    )


def _quoted(text: str) -> str:
    return text if re.fullmatch(r"[A-Za-z_][\w./-]*", text) else f'"{text}"'


def _remarks(model: mujoco.MjModel, log: Path, guess: Guess) -> list[str]:
    said = [f"time is column {guess.time!r} in {guess.time_unit}"]
    said += [f"{t} is column {c!r}{f' in {u}' if u else ''}" for t, (c, u) in guess.drive.items()]
    said += [f"{t} is column {c!r} in {u}" for t, (c, u) in guess.measured.items()]
    unmeasured = [
        name for name in names_of(model, "joint") if f"joint[{name}].position" not in guess.measured
    ]
    if unmeasured:
        said.append(
            f"no position was found for {', '.join(unmeasured)}: name its column, or weld the joint"
        )
    if not guess.drive:
        said.append(f"no column of {log.name} looks like a command: name what drives the robot")
    return said
