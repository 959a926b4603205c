"""What a page shows of a robot, as plain data: windows as they were predicted, missing torques."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from robotcast.robots.names import name_of_dof, turning
from robotcast.robots.robot_case import RobotCase
from robotcast.robots.sizes import dynamics

QUANTILES = (0.5, 0.9, 1.0)  # of the windows, by what the model as it is misses


def shown(case: RobotCase, base: Mapping[str, Any], last: Mapping[str, Any]) -> dict[str, Any]:
    """Return `robot` of diagnosis.json: windows with traces, and torques against speed.

    From its `base` and its `model`, the last, which may be empty.
    """
    before = _predicted(case, (), [p["value"] for p in base["parameters"].values()])
    after = before
    if last:
        after = _predicted(case, last["effects"], [p["value"] for p in last["parameters"].values()])
    return {**_traces(case, before, after), "torques": _torques(case)}


def preview(case: RobotCase) -> dict[str, Any]:
    """Return signals and windows of the model as the file has it."""
    path = _predicted(case, (), [p.nominal for p in case.model.parameters])
    return _traces(case, path, path)


def _predicted(case: RobotCase, effects: Sequence[str], values: Sequence[float]) -> np.ndarray:
    return case.model.predict(case.model.records, effects, np.array([values], float))[0]


def _traces(case: RobotCase, before: np.ndarray, after: np.ndarray) -> dict[str, Any]:
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
    usual = [scale * model.usual_misses(some) for some in (off, off_after)]
    signals = [
        {"name": axis.name, "unit": axis.unit, "base": base, "model": last, "floor": least}
        for axis, base, last, least in zip(axes, *usual, scale * case.floor.signals, strict=True)
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
