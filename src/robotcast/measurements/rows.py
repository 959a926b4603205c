"""The rules that single rows of a set's tables must satisfy, and what is put right on reading.

A row that breaks a rule refuses the set, by file and line. What is unmistakable is put right and
said: rows that stand there twice, angles that jump by 2π, equal actions under several numbers.
"""

from collections.abc import Callable

import numpy as np
import polars as pl
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from robotcast.casts.action import ACTION_COLUMNS
from robotcast.casts.table import Table

SAME_ACTION = 1e-4  # rad, m, m/s: less than any arm repeats to
DOUBLE_STAMP = 0.01  # of the mean time between rows: such a row repeats the one before

Say = Callable[[str], None]


def tidy_actions(actions: Table, say: Say) -> Table:
    """Refuse casts that cannot be; give equal actions one number, and angles their turn."""
    if len(actions.rows) == 0:
        raise ValueError(f"{actions.path}: holds no casts")
    trials = actions.columns["trial"]
    again = ~pl.Series(trials).is_first_distinct().to_numpy()
    actions.refuse_where(again, lambda i: f"trial {trials[i]} stands there twice")
    _refuse_mixed_repeats(actions)
    columns = dict(actions.columns)
    for name in ("theta1", "theta2", "alpha"):
        far = np.abs(columns[name]) > np.pi
        columns[name] = np.where(far, np.angle(np.exp(1j * columns[name])), columns[name])
        if far.any():
            say(f"{actions.place(int(np.argmax(far)))}: {name} is beyond π and was turned by 2π")
    numbers, ids = np.stack([columns[n] for n in ACTION_COLUMNS], axis=1), columns["action"]
    one, other = KDTree(numbers).query_pairs(SAME_ACTION, p=np.inf, output_type="ndarray").T
    near = coo_array((np.ones(len(one)), (one, other)), shape=(len(ids), len(ids)))
    group = connected_components(near, directed=False)[1]
    _, first = np.unique(group, return_index=True)
    columns["action"] = ids[first[group]]
    if (renamed := columns["action"] != ids).any():
        row = int(np.argmax(renamed))
        say(
            f"{actions.place(row)}: action {ids[row]} is action {columns['action'][row]} again; "
            f"{renamed.sum()} casts that repeat an action under another number count as repeats"
        )
    return Table(actions.path, columns, actions.rows, actions.others)


def tidy_log(table: Table, actions: Table, least: int, what: str, say: Say) -> Table:
    """Return the rows cast by cast, in the order of the actions, in time that increases.

    Refuses rows of no known cast, time that does not increase, and casts with too few rows.
    """
    trials, known = table.columns["trial"], actions.columns["trial"]
    table.refuse_where(
        ~np.isin(trials, known),
        lambda i: f"trial {trials[i]} is unknown; {actions.path.name} does not list it",
    )
    sorter = np.argsort(known)
    cast = sorter[np.searchsorted(known, trials, sorter=sorter)]
    order = np.argsort(cast, kind="stable")
    table, cast = table.take(order), cast[order]
    table, cast = _without_doubles(table, cast, say)
    _refuse_time(table, cast)
    have = np.bincount(cast, minlength=len(known))
    actions.refuse_where(
        have < least,
        lambda i: (
            f"trial {known[i]} has {have[i] or 'no'} {what} in {table.path.name}"
            + (f", expected at least {least}" if least > 1 else "")
        ),
    )
    return table


def unwrapped(tool: Table, say: Say) -> np.ndarray:
    """Return yaw [rad], (n_rows,), without jumps by 2π and within half a turn of 0 at the start."""
    trials, yaw = tool.columns["trial"], tool.columns["yaw"]
    first = np.flatnonzero(np.diff(trials, prepend=trials[:1] - 1))
    step = np.diff(yaw, prepend=yaw[:1])
    turns = np.round(step / (2 * np.pi))
    turns[first] = np.round(yaw[first] / (2 * np.pi))
    jumps = np.delete(turns, first)
    if jumps.any():
        row = int(np.setdiff1d(np.flatnonzero(turns), first)[0])
        say(f"{tool.place(row)}: yaw jumps by 2π, here and {np.count_nonzero(jumps)} times in all")
    counted = np.cumsum(turns)
    before = (counted - turns)[first]
    lengths = np.diff(np.append(first, len(yaw)))
    return yaw - 2 * np.pi * (counted - np.repeat(before, lengths))


def _refuse_mixed_repeats(actions: Table) -> None:
    numbers = np.stack([actions.columns[name] for name in ACTION_COLUMNS], axis=1)
    ids = actions.columns["action"]
    _, first, group = np.unique(ids, return_index=True, return_inverse=True)
    differs = np.abs(numbers - numbers[first[group]]).max(axis=1) > SAME_ACTION
    actions.refuse_where(
        differs,
        lambda i: (
            f"action {ids[i]} has other numbers than at "
            f"{actions.place(int(first[group[i]])).removeprefix(f'{actions.path} ')}; "
            "casts share an action number only when they repeat the action"
        ),
    )


def _without_doubles(table: Table, cast: np.ndarray, say: Say) -> tuple[Table, np.ndarray]:
    """Leave out rows that stand there twice, as loggers write that ask faster than they are told.

    A stamp that was moved a little so that time increases makes no other row.
    """
    t_s = table.columns["t"]
    inside = np.diff(cast, prepend=-1) == 0
    dt_s = np.where(inside, np.diff(t_s, prepend=0.0), np.inf)
    first = np.flatnonzero(~inside)
    last = np.append(first[1:], len(t_s)) - 1
    mean_s = (t_s[last] - t_s[first]) / np.maximum(last - first, 1)
    numbers = np.stack(list(table.columns.values()), axis=1)
    equal = inside & (np.diff(numbers, axis=0, prepend=numbers[:1]) == 0).all(axis=1)
    close = (dt_s > 0) & (dt_s < DOUBLE_STAMP * mean_s[np.cumsum(~inside) - 1])
    if not (double := equal | close).any():
        return table, cast
    row = int(np.argmax(double))
    say(f"{table.place(row)}: repeats the row before it; {double.sum()} such rows are left out")
    return table.take(np.flatnonzero(~double)), cast[~double]


def _refuse_time(table: Table, cast: np.ndarray) -> None:
    trials, t_s = table.columns["trial"], table.columns["t"]
    stuck = (np.diff(cast, prepend=-1) == 0) & (np.diff(t_s, prepend=0.0) <= 0)
    table.refuse_where(
        stuck,
        lambda i: (
            f"time must increase within a trial; t is {t_s[i]:g} and not above the t before it in "
            f"trial {trials[i]}: rows out of order, or a clock that began again"
        ),
    )
