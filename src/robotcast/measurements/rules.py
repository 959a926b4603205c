"""What the tables of a measurement set must satisfy; each rule refuses with one sentence."""

import math

import numpy as np

from robotcast.measurements.table import Table

MOST_ANGLE_RAD = 2 * math.pi
MOST_COORDINATE_M = 10.0
MOST_SPEED_M_S = 10.0
MOST_TIME_S = 60.0
SAME_ACTION = 1e-6


def check_actions(actions: Table) -> None:
    """Refuse casts that cannot be: none at all, one number twice, wrong units, mixed repeats."""
    if len(actions.rows) == 0:
        raise ValueError(f"{actions.path}: holds no casts")
    _refuse_repeated_trials(actions)
    for name in ("theta1", "theta2", "alpha"):
        _refuse_degrees(actions, name)
    for name in ("r1", "r2"):
        _refuse_not_positive(actions, name)
        _refuse_millimetres(actions, name)
    _refuse_not_positive(actions, "vmax")
    speed = actions.columns["vmax"]
    actions.refuse_where(
        speed > MOST_SPEED_M_S,
        lambda i: (
            f"vmax is {speed[i]:g}, beyond {MOST_SPEED_M_S:g} m/s; "
            "millimetres per second where metres per second are expected?"
        ),
    )
    _refuse_mixed_repeats(actions)


def check_motion(table: Table, actions: Table) -> None:
    """Refuse rows of no known cast, time that does not increase and coordinates in wrong units."""
    trials, known = table.columns["trial"], actions.columns["trial"]
    table.refuse_where(
        ~np.isin(trials, known),
        lambda i: f"trial {trials[i]} is unknown; {actions.path.name} does not list it",
    )
    _refuse_time(table)
    for name in ("x", "y"):
        _refuse_millimetres(table, name)
    if "yaw" in table.columns:
        _refuse_degrees(table, "yaw")


def check_complete(table: Table, actions: Table, *, least: int, what: str) -> None:
    """Refuse a cast with fewer than `least` rows in `table`."""
    trials = actions.columns["trial"]
    numbers, counts = np.unique(table.columns["trial"], return_counts=True)
    count = dict(zip(numbers.tolist(), counts.tolist(), strict=True))
    have = np.array([count.get(trial, 0) for trial in trials.tolist()])
    actions.refuse_where(
        have < least,
        lambda i: (
            f"trial {trials[i]} has {have[i] or 'no'} {what} in {table.path.name}"
            + (f", expected at least {least}" if least > 1 else "")
        ),
    )


def _refuse_repeated_trials(actions: Table) -> None:
    trials = actions.columns["trial"]
    _, first = np.unique(trials, return_index=True)
    again = ~np.isin(np.arange(len(trials)), first)
    actions.refuse_where(again, lambda i: f"trial {trials[i]} stands there twice")


def _refuse_mixed_repeats(actions: Table) -> None:
    names = [name for name in actions.columns if name not in ("trial", "action")]
    numbers = np.stack([actions.columns[name] for name in names], axis=1)
    ids = actions.columns["action"]
    _, first, group = np.unique(ids, return_index=True, return_inverse=True)
    differs = np.abs(numbers - numbers[first[group]]).max(axis=1) > SAME_ACTION
    actions.refuse_where(
        differs,
        lambda i: (
            f"action {ids[i]} has other numbers than at {_row(actions, int(first[group[i]]))}; "
            "casts share an action number only when they repeat the action"
        ),
    )


def _row(table: Table, index: int) -> str:
    return table.place(index).removeprefix(f"{table.path} ")


def _refuse_time(table: Table) -> None:
    trials, t_s = table.columns["trial"], table.columns["t"]
    table.refuse_where(t_s < 0, lambda i: f"t is {t_s[i]:g}, before the start of the cast at t = 0")
    table.refuse_where(
        t_s > MOST_TIME_S,
        lambda i: (
            f"t is {t_s[i]:g}, beyond {MOST_TIME_S:g} s; milliseconds where seconds are expected?"
        ),
    )
    order = np.argsort(trials, kind="stable")
    same_trial = np.diff(trials[order]) == 0
    stuck = np.zeros(len(trials), dtype=bool)
    stuck[order[1:]] = same_trial & (np.diff(t_s[order]) <= 0)
    table.refuse_where(
        stuck,
        lambda i: (
            f"time must increase within a trial; t is {t_s[i]:g} and not above the t "
            f"before it in trial {trials[i]}"
        ),
    )


def _refuse_degrees(table: Table, name: str) -> None:
    angle = table.columns[name]
    table.refuse_where(
        np.abs(angle) > MOST_ANGLE_RAD,
        lambda i: f"{name} is {angle[i]:g}, beyond 2π; degrees where radians are expected?",
    )


def _refuse_millimetres(table: Table, name: str) -> None:
    value = table.columns[name]
    table.refuse_where(
        np.abs(value) > MOST_COORDINATE_M,
        lambda i: (
            f"{name} is {value[i]:g}, beyond {MOST_COORDINATE_M:g} m; "
            "millimetres where metres are expected?"
        ),
    )


def _refuse_not_positive(table: Table, name: str) -> None:
    value = table.columns[name]
    table.refuse_where(value <= 0, lambda i: f"{name} must be above zero, got {value[i]:g}")
