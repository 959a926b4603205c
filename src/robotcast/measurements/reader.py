"""Reading a measurement set from disk, checked."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from robotcast.casts.action import ACTION_COLUMNS, Action, ToolMotion
from robotcast.casts.plan import PlanLimits, plan_action
from robotcast.casts.table import TABLE_COLUMNS, Table, find_table, read_table
from robotcast.measurements.logs import Logs
from robotcast.measurements.measurement_set import MeasurementSet, Trial
from robotcast.measurements.rig_file import read_rig_file
from robotcast.measurements.rows import Say, tidy_actions, tidy_log, unwrapped
from robotcast.measurements.rules import Outcome, check, heading_off

DEFAULT_LIMITS = PlanLimits()
NO_TOOL = "the set has no tool.csv; the planned motion of its actions stands in for it"
TURNED_RAD = 0.3  # about a quarter turn, in which the cable lies at the start of nearly all casts
NEARLY_ALL = 0.8


def read_measurement_set(folder: Path, limits: PlanLimits = DEFAULT_LIMITS) -> MeasurementSet:
    """Read a measurement set, its tables as CSV or Parquet.

    What was put right on reading, what is doubtful and which casts are left out, or have no
    endpoint, stands in its `notices`.

    Parameters
    ----------
    limits : how a cast is planned; a set without a tool table falls back on the planned motion
        of its actions.

    Raises
    ------
    ValueError
        One sentence that names the file, the row (the line of a CSV file, counting the header
        as line 1; the row of a Parquet file, from 1) and the rule that it breaks.
    """
    if not folder.is_dir():
        raise ValueError(f"{folder}: there is no such folder; expected a measurement set")
    rig_path = folder / "rig.yaml"
    if not rig_path.is_file():
        raise ValueError(f"{folder}: rig.yaml is missing; a measurement set needs it")
    facts, notices = read_rig_file(rig_path), []
    actions = tidy_actions(_needed_table(folder, "actions"), notices.append)
    waypoints = _needed_table(folder, "waypoints")
    waypoints = tidy_log(waypoints, actions, 1, "waypoints", notices.append)
    logged = _logged_tools(folder, actions, notices.append)
    tools = logged or _planned(actions, facts.r0_m, limits)
    read = MeasurementSet(
        cable=facts.cable,
        r0_m=facts.r0_m,
        period_s=facts.period_s,
        noise_m=facts.noise_m,
        trials=_trials(actions, waypoints, tools),
        rig=facts.rig,
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
        path = folder / found.where if "." in found.where else find_table(folder, found.where)
        said.append(f"{path or folder / found.where}: {found.sentence}")
        if found.outcome is Outcome.REFUSED:
            raise ValueError(said[-1])
        if found.outcome is Outcome.UNUSABLE:
            lost |= set(found.casts)
        elif found.outcome is Outcome.UNRESTED:
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


def _planned(actions: Table, r0_m: float, limits: PlanLimits) -> list[ToolMotion]:
    planned = []
    for index, action in enumerate(_actions(actions)):
        try:
            planned.append(plan_action(action, r0_m=r0_m, limits=limits).tool)
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
