"""Reading a measurement set from disk, checked."""

from pathlib import Path

import numpy as np

from robotcast.casts.action import ACTION_COLUMNS, Action
from robotcast.casts.plan import PlanLimits, plan_action
from robotcast.casts.tool_motion import ToolMotion
from robotcast.measurements.measurement_set import MeasurementSet, Trial
from robotcast.measurements.rig_file import read_rig_file
from robotcast.measurements.rules import check_actions, check_complete, check_motion
from robotcast.measurements.table import TABLE_COLUMNS, Table, find_table, read_table

DEFAULT_LIMITS = PlanLimits()


def read_measurement_set(folder: Path, limits: PlanLimits = DEFAULT_LIMITS) -> MeasurementSet:
    """Read a measurement set, its tables as CSV or Parquet.

    Parameters
    ----------
    limits : how a cast is planned; a set without a tool table falls back on the planned motion
        of its actions, and its `notice` says so.

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
    facts = read_rig_file(rig_path)
    actions = _needed_table(folder, "actions")
    check_actions(actions)
    waypoints = _needed_table(folder, "waypoints")
    check_motion(waypoints, actions)
    check_complete(waypoints, actions, least=1, what="waypoints")
    logged = _logged_tools(folder, actions)
    return MeasurementSet(
        cable=facts.cable,
        r0_m=facts.r0_m,
        period_s=facts.period_s,
        noise_m=facts.noise_m,
        trials=_trials(actions, waypoints, logged or _planned(actions, facts.r0_m, limits)),
        rig=facts.rig,
        tool_planned=logged is None,
    )


def _needed_table(folder: Path, name: str) -> Table:
    path = find_table(folder, name)
    if path is None:
        raise ValueError(
            f"{folder}: {name}.csv (or {name}.parquet) is missing; a measurement set needs it"
        )
    return read_table(path, TABLE_COLUMNS[name])


def _logged_tools(folder: Path, actions: Table) -> list[ToolMotion] | None:
    path = find_table(folder, "tool")
    if path is None:
        return None
    tool = read_table(path, TABLE_COLUMNS["tool"])
    check_motion(tool, actions)
    check_complete(tool, actions, least=2, what="samples")
    rows = _rows_by_trial(tool)
    pose = np.stack([tool.columns[name] for name in ("x", "y", "yaw")], axis=1)
    return [
        ToolMotion(tool.columns["t"][rows[trial]], pose[rows[trial]])
        for trial in actions.columns["trial"].tolist()
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


def _trials(actions: Table, waypoints: Table, tools: list[ToolMotion]) -> tuple[Trial, ...]:
    rows = _rows_by_trial(waypoints)
    xy_m = np.stack([waypoints.columns["x"], waypoints.columns["y"]], axis=1)
    numbers, ids = actions.columns["trial"].tolist(), actions.columns["action"].tolist()
    order = (np.argsort(np.argsort(numbers)) / max(len(numbers) - 1, 1)).tolist()
    return tuple(
        Trial(
            trial=trial,
            action_id=action_id,
            action=action,
            tool=tool,
            waypoints_s=waypoints.columns["t"][rows[trial]],
            waypoints_m=xy_m[rows[trial]],
            logged={n: float(v[row]) for n, v in actions.others.items()} | {"order": order[row]},
        )
        for row, (trial, action_id, action, tool) in enumerate(
            zip(numbers, ids, _actions(actions), tools, strict=True)
        )
    )


def _rows_by_trial(table: Table) -> dict[int, np.ndarray]:
    trials = table.columns["trial"]
    order = np.argsort(trials, kind="stable")
    numbers, starts = np.unique(trials[order], return_index=True)
    return dict(zip(numbers.tolist(), np.split(order, starts[1:]), strict=True))
