"""Measurement sets on disk, rig.yaml and the tables: read and checked, written once in one step."""

import math
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import yaml

from robotcast.casts.action import ACTION_COLUMNS, Action, ToolMotion
from robotcast.casts.plan import PlanLimits, plan_action
from robotcast.casts.table import TABLE_COLUMNS, Table, find_table, read_table
from robotcast.files import atomic_folder, read_mapping
from robotcast.measurements.logs import Logs
from robotcast.measurements.measurement_set import Cable, MeasurementSet, Trial
from robotcast.measurements.rows import Say, tidy_actions, tidy_log, unwrapped
from robotcast.measurements.rules import check, heading_off

MOST = 10.0  # m, kg or s, of every number
MISTAKEN = {
    "m": "millimetres where metres",
    "kg": "grams where kilograms",
    "s": "milliseconds where seconds",
}
MAY_BE_ZERO = ("cable.endpoint_mass_kg", "camera.noise_m")


def _rig_file(path: Path) -> MeasurementSet:
    """Read and check rig.yaml: a set without casts yet. Messages name the key of the short file."""
    facts = read_mapping(path, "the keys cable, robot and camera")
    names = ("length_m", "mass_kg", "radius_m", "endpoint_mass_kg")
    sizes = {name: _number(path, facts, f"cable.{name}") for name in names}
    if sizes["radius_m"] >= sizes["length_m"]:
        raise ValueError(
            f"{path}: cable.radius_m {sizes['radius_m']:g} is not below cable.length_m "
            f"{sizes['length_m']:g}; millimetres where metres are expected?"
        )
    noise_known = _find(facts, "camera.noise_m") is not None
    return MeasurementSet(
        cable=Cable(name=_name(path, facts, "cable.name"), **sizes),
        r0_m=_number(path, facts, "robot.r0_m"),
        period_s=_number(path, facts, "camera.period_s"),
        noise_m=_number(path, facts, "camera.noise_m") if noise_known else None,
        trials=(),
        rig=_name(path, facts, "rig") if "rig" in facts else "recorded",
    )


def _rig_file_text(measured: MeasurementSet) -> str:
    """Return rig.yaml of a set, numbers with all their digits."""
    cable = {k: v if k == "name" else float(v) for k, v in asdict(measured.cable).items()}
    camera = {"period_s": float(measured.period_s)}
    if measured.noise_m is not None:
        camera["noise_m"] = float(measured.noise_m)
    robot = {"r0_m": float(measured.r0_m)}
    content = {"rig": measured.rig, "cable": cable, "robot": robot, "camera": camera}
    return yaml.safe_dump(content, sort_keys=False, allow_unicode=True)


def _find(facts: dict[str, Any], key: str) -> Any:
    value: Any = facts
    for part in key.split("."):
        value = value.get(part) if isinstance(value, dict) else None
    return value


def _name(path: Path, facts: dict[str, Any], key: str) -> str:
    value = _find(facts, key)
    if value is None or isinstance(value, dict | list) or not str(value).strip():
        raise ValueError(f"{path}: {key} must be a name, got {_said(value)}")
    return str(value)


def _number(path: Path, facts: dict[str, Any], key: str) -> float:
    value, zero = _find(facts, key), key in MAY_BE_ZERO
    try:  # YAML 1.1 reads 1e-3, without a dot, as a word
        number = math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not (math.isfinite(number) and number >= 0 and (number or zero)):
        wanted = "a finite number, zero or above" if zero else "a finite number above zero"
        raise ValueError(f"{path}: {key} must be {wanted}, got {_said(value)}")
    if number > MOST:
        mistaken = MISTAKEN[key.rpartition("_")[2]]
        raise ValueError(f"{path}: {key} is {number:g}, beyond {MOST:g}; {mistaken} are expected?")
    return number


def _said(value: Any) -> str:
    return "nothing" if value is None else repr(value)


NO_TOOL = "the set has no tool.csv; the planned motion of its actions stands in for it"
TURNED_RAD = 0.3  # about a quarter turn, in which the cable lies at the start of nearly all casts
NEARLY_ALL = 0.8


def read_measurement_set(folder: Path) -> MeasurementSet:
    """Read a measurement set, its tables as CSV or Parquet, or refuse it (ValueError).

    What was put right on reading, what is doubtful and which casts are left out, or have no
    endpoint, stands in its `notices`. Without a tool table, the planned motion of the actions
    stands in for it. The refusal is one sentence that names the file, the row (the line of a CSV
    file, counting the header as line 1; the row of a Parquet file, from 1) and the rule that it
    breaks.
    """
    if not folder.is_dir():
        raise ValueError(f"{folder}: there is no such folder; expected a measurement set")
    rig_path = folder / "rig.yaml"
    if not rig_path.is_file():
        raise ValueError(f"{folder}: rig.yaml is missing; a measurement set needs it")
    bare, notices = _rig_file(rig_path), []
    actions = tidy_actions(_needed_table(folder, "actions"), notices.append)
    waypoints = _needed_table(folder, "waypoints")
    waypoints = tidy_log(waypoints, actions, 1, "waypoints", notices.append)
    logged = _logged_tools(folder, actions, notices.append)
    tools = logged or _planned(actions, bare.r0_m)
    read = replace(
        bare,
        trials=_trials(actions, waypoints, tools),
        tool_planned=logged is None,
        notices=(*([] if logged else [NO_TOOL]), *notices),
    )
    return judged(_yaw_along_cable(read), folder)


def judged(measured: MeasurementSet, folder: Path) -> MeasurementSet:
    """Return the set in `folder` with what its rules find.

    Casts that cannot be used are left out, those whose end was not seen at rest marked.
    """
    lost: set[int] = set()
    unrested: set[int] = set()
    said: list[str] = []
    most = len(measured.trials) / 2
    for found in check(Logs(measured)):
        if len(lost) > most or (found.casts and lost.issuperset(found.casts)):
            continue
        path = folder / found.where
        if not path.suffix:
            path = find_table(folder, found.where) or path.with_suffix(".csv")
        said.append(f"{path}: {found.sentence}")
        if found.then == "refused":
            raise ValueError(said[-1])
        if found.then == "unusable":
            lost |= set(found.casts)
        elif found.then == "unrested":
            unrested |= set(found.casts)
    if len(lost) > most:
        raise ValueError(
            f"{folder}: {len(lost)} of {len(measured.trials)} casts cannot be used; "
            + "; ".join(said)
        )
    trials = tuple(
        replace(trial, rested=False) if i in unrested else trial
        for i, trial in enumerate(measured.trials)
        if i not in lost
    )
    return replace(measured, trials=trials, notices=(*measured.notices, *said))


def _yaw_along_cable(measured: MeasurementSet) -> MeasurementSet:
    """Turn yaw by quarter turns where the flange was mounted so: it points along the cable."""
    off = heading_off(Logs(measured))
    off = off[np.isfinite(off)]
    if measured.tool_planned or not len(off):
        return measured
    quarters = round(float(np.angle(np.exp(1j * off).mean())) / (np.pi / 2))
    turn = quarters * np.pi / 2
    near = np.abs(np.angle(np.exp(1j * (off - turn)))) < TURNED_RAD
    if not quarters or near.mean() < NEARLY_ALL:
        return measured
    trials = tuple(
        replace(t, tool=ToolMotion(t.tool.t_s, t.tool.pose + np.array([0.0, 0.0, turn])))
        for t in measured.trials
    )
    notice = (
        f"tool: the cable lies {turn:.2f} rad from yaw when casts start; yaw was turned so that "
        "it points along the cable"
    )
    return replace(measured, trials=trials, notices=(*measured.notices, notice))


def _needed_table(folder: Path, name: str) -> Table:
    path = find_table(folder, name)
    if path is None:
        raise ValueError(
            f"{folder}: {name}.csv (or {name}.parquet) is missing; a measurement set needs it"
        )
    return read_table(path, TABLE_COLUMNS[name])


def _logged_tools(folder: Path, actions: Table, say: Say) -> list[ToolMotion] | None:
    path = find_table(folder, "tool")
    if path is None:
        return None
    tool = tidy_log(read_table(path, TABLE_COLUMNS["tool"]), actions, 2, "samples", say)
    pose = np.stack([tool.columns["x"], tool.columns["y"], unwrapped(tool, say)], axis=1)
    at = _cuts(tool)
    return [
        ToolMotion(t_s, poses)
        for t_s, poses in zip(np.split(tool.columns["t"], at), np.split(pose, at), strict=True)
    ]


def _planned(actions: Table, r0_m: float) -> list[ToolMotion]:
    planned = []
    for index, action in enumerate(_actions(actions)):
        try:
            planned.append(plan_action(action, r0_m=r0_m, limits=PlanLimits()).tool)
        except ValueError as error:
            raise ValueError(
                f"{actions.place(index)}: without tool.csv the motion is planned, "
                f"and this cast cannot be: {error}"
            ) from None
    return planned


def _actions(actions: Table) -> list[Action]:
    numbers = np.stack([actions.columns[name] for name in ACTION_COLUMNS], axis=1)
    return [Action.from_array(row) for row in numbers]


def _trials(actions: Table, waypoints: Table, tools: Sequence[ToolMotion]) -> tuple[Trial, ...]:
    at = _cuts(waypoints)
    t_s = np.split(waypoints.columns["t"], at)
    xy_m = np.split(np.stack([waypoints.columns["x"], waypoints.columns["y"]], axis=1), at)
    numbers, ids = actions.columns["trial"].tolist(), actions.columns["action"].tolist()
    order = (np.argsort(np.argsort(numbers)) / max(len(numbers) - 1, 1)).tolist()
    others = dict(actions.others)
    rested = others.pop("rested", np.ones(len(numbers)))
    return tuple(
        Trial(
            trial=trial,
            action_id=action_id,
            action=action,
            tool=tool,
            waypoints_s=t_s[row],
            waypoints_m=xy_m[row],
            logged={n: float(v[row]) for n, v in others.items()} | {"order": order[row]},
            rested=bool(rested[row]),
        )
        for row, (trial, action_id, action, tool) in enumerate(
            zip(numbers, ids, _actions(actions), tools, strict=True)
        )
    )


def _cuts(table: Table) -> np.ndarray:
    """Return the rows at which another cast begins, of a table that stands cast by cast."""
    return np.flatnonzero(np.diff(table.columns["trial"])) + 1


@contextmanager
def replaced(folder: Path) -> Iterator[Path]:
    """Yield where to write a set that takes the place of `folder` once it can be read."""
    draft = folder.with_name(f".{folder.name}.draft")
    shutil.rmtree(draft, ignore_errors=True)
    try:
        yield draft
        read_measurement_set(draft)
        shutil.rmtree(folder, ignore_errors=True)
        draft.rename(folder)
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def write_measurement_set(measured: MeasurementSet, folder: Path) -> None:
    """Write a set to `folder`, which must not exist yet: a set on disk is never changed.

    The same set gives the same bytes; numbers are written with all their digits, so that
    reading gives the set back. A planned tool motion is not written: it was not measured.
    """
    if folder.exists():
        raise ValueError(
            f"{folder}: exists already; a measurement set is never changed in place, "
            "write to another folder"
        )
    if not measured.trials:
        raise ValueError(f"{folder}: a measurement set without casts is not written")
    with atomic_folder(folder) as unfinished:
        (unfinished / "rig.yaml").write_text(_rig_file_text(measured), encoding="utf-8")
        for name, columns in _tables(measured).items():
            pl.DataFrame(columns).write_csv(unfinished / f"{name}.csv")


def _tables(measured: MeasurementSet) -> dict[str, dict[str, np.ndarray]]:
    """Return the columns of each table; the order of the casts is never written."""
    trials = measured.trials
    numbers = np.array([t.trial for t in trials])
    actions = np.stack([t.action.as_array() for t in trials])
    logged = sorted(set.intersection(*(set(t.logged) for t in trials)) - {"order"})
    tables = {
        "actions": {"trial": numbers, "action": np.array([t.action_id for t in trials])}
        | dict(zip(ACTION_COLUMNS, actions.T, strict=True))
        | {name: np.array([t.logged[name] for t in trials]) for name in logged}
    }
    if not all(t.rested for t in trials):
        tables["actions"]["rested"] = np.array([int(t.rested) for t in trials])
    logs = {"waypoints": [(t.waypoints_s, t.waypoints_m) for t in trials]}
    if not measured.tool_planned:
        logs["tool"] = [(t.tool.t_s, t.tool.pose) for t in trials]
    for name, log in logs.items():
        counts = [len(t_s) for t_s, _ in log]
        values = np.concatenate([some for _, some in log])
        tables[name] = {
            "trial": np.repeat(numbers, counts),
            "t": np.concatenate([t_s for t_s, _ in log]),
        } | dict(zip(TABLE_COLUMNS[name][2:], values.T, strict=True))
    return tables
