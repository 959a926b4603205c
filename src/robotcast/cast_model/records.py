"""Measured casts as records, with the phases of their motion."""

import numpy as np

from robotcast.casts.tool_motion import ToolMotion
from robotcast.diagnosis.model import Record
from robotcast.measurements.measurement_set import MeasurementSet, Trial

STOPPED_M_S = 0.02  # the tool is slower than this once it has stopped
TURNING_S = 0.1  # before and after the tool rests in θ1: the reversal
STILL_M = 0.005  # the end is at rest once it stays this close to where it ends


def cast_records(measured: MeasurementSet) -> tuple[Record, ...]:
    """Return a record of every cast that was tracked."""
    return tuple(_record(trial) for trial in measured.trials if len(trial.waypoints_s))


def _record(trial: Trial) -> Record:
    return Record(
        trial=trial.trial,
        group=trial.action_id,
        times_s=trial.waypoints_s,
        measured=trial.waypoints_m,
        factors={name: value for name, value in trial.factors.items() if name != "r1"},
        phases=_phases(trial),
    )


def _phases(trial: Trial) -> dict[str, float]:
    """Return when each phase of the motion starts [s]."""
    tool = trial.tool
    stop_s = _stop_s(tool)
    turn_s = _turn_s(tool, stop_s)
    from_end_m = np.linalg.norm(trial.waypoints_m - trial.endpoint_m, axis=1)
    moving = np.flatnonzero(from_end_m > STILL_M)
    rest_s = trial.waypoints_s[min(moving[-1] + 1, len(from_end_m) - 1)] if moving.size else stop_s
    return {
        "first arc": 0.0,
        "reversal": max(turn_s - TURNING_S, 0.0),
        "second arc": min(turn_s + TURNING_S, stop_s),
        "coast": stop_s,
        "rest": max(float(rest_s), stop_s),
    }


def _stop_s(tool: ToolMotion) -> float:
    """Return when the tool comes to rest."""
    speed = np.linalg.norm(np.gradient(tool.pose[:, :2], tool.t_s, axis=0), axis=1)
    return float(tool.t_s[np.flatnonzero(speed > STOPPED_M_S).max(initial=0)])


def _turn_s(tool: ToolMotion, stop_s: float) -> float:
    """Return when the tool turns back: the extreme of its angle about the base on the way."""
    angle = np.unwrap(np.arctan2(tool.pose[:, 1], tool.pose[:, 0]))
    final = np.sign(angle[-1] - angle[0]) or 1.0
    on_the_way = tool.t_s <= stop_s
    return float(tool.t_s[on_the_way][np.argmin(final * angle[on_the_way])])
