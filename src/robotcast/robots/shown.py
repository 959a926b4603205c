"""What a page shows of a robot, as plain data: windows as they were predicted, missing torques."""

from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

from robotcast.robots.names import joint_of_dof
from robotcast.robots.robot_case import RobotCase
from robotcast.robots.sizes import inverse_states

QUANTILES = (0.5, 0.9, 1.0)  # of the windows, by what the model as it is misses
MOST_STATES = 400


def shown(case: RobotCase, said: Mapping[str, Any]) -> dict[str, Any]:
    """Return `robot` of diagnosis.json: windows with traces, and torques against speed."""
    before = _predicted(case, (), [p["value"] for p in said["base"]["parameters"].values()])
    last, after = said["model"], before
    if last:
        values = [p["value"] for p in last["parameters"].values()]
        after = _predicted(case, last["effects"], values)
    return {**_traces(case, before, after), "torques": _torques(case)}


def preview(case: RobotCase) -> dict[str, Any]:
    """Return signals and windows of the model as the file has it."""
    path = _predicted(case, (), [p.nominal for p in case.model.parameters])
    return _traces(case, path, path)


def _traces(case: RobotCase, before: np.ndarray, after: np.ndarray) -> dict[str, Any]:
    model = case.model
    missed = [
        float(np.nanmean(np.linalg.norm(path[: len(r.times_s)] - r.measured, axis=1)))
        for path, r in zip(before, model.records, strict=True)
    ]
    order = np.argsort(np.nan_to_num(missed, nan=np.inf), kind="stable")
    found = []
    for share in QUANTILES:
        record = model.records[order[round(share * (len(order) - 1))]]
        k, window = len(record.times_s), model.rollout.windows[record.trial]
        log = model.rollout.logs[window.log]
        found.append(
            {
                "window": record.trial,
                "log": log.path.name,
                "start_s": log.times_s[window.first],
                "times_s": record.times_s,
                "measured": record.measured * model.units.si,
                "base": before[record.trial, :k] * model.units.si,
                "model": after[record.trial, :k] * model.units.si,
            }
        )
    signals = [{"name": at.name, "unit": at.unit} for at in case.robot.measured]
    return {"signals": signals, "windows": found}


def _predicted(case: RobotCase, effects: Sequence[str], values: Sequence[float]) -> np.ndarray:
    return case.model.predict(case.model.records, effects, np.array([values], float))[0]


def _torques(case: RobotCase) -> list[dict[str, Any]]:
    """Return of every joint, at states of the logs, what it was driven by less what it needed.

    By the model as it is: dry friction shows as a step, viscous friction as a slope.
    """
    robot, rollout = case.robot, case.model.rollout
    model = robot.model
    data, rows = mujoco.MjData(model), []
    for log, first, qpos, qvel, qacc in inverse_states(rollout.logs, case.starts, MOST_STATES):
        data.qpos[:], data.qvel[:], data.qacc[:] = qpos, qvel, qacc
        mujoco.mj_inverse(model, data)
        needed = data.qfrc_inverse.copy()
        given = np.zeros(model.nv)
        for value, at in zip(rollout.logs[log].drive[first], robot.drive, strict=True):
            if at.dof is not None:
                given[at.dof] += value
            else:
                data.ctrl[at.actuator] = value
        mujoco.mj_forward(model, data)
        rows.append((qvel, given + data.qfrc_actuator - needed))
    speed, missing = (np.array(part) for part in zip(*rows, strict=True))
    return [
        {
            "joint": joint_of_dof(model, dof),
            "hinge": bool(case.sizes.hinge[dof]),
            "speed": speed[:, dof],
            "torque": missing[:, dof],
        }
        for dof in range(model.nv)
    ]
