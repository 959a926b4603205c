"""Logs of a robot: read, converted to SI units, and checked before anything is simulated."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import polars as pl

from robotcast.robots.names import Signal
from robotcast.robots.robot_file import Column, RobotFile

FASTEST = {"rad": 500.0, "m": 50.0}  # per second, between two samples: no joint moves like that
BEYOND = {"rad": 1.0, "m": 0.5}  # outside of a joint's range
PLATEAU = 20  # samples at the same extreme in a row, of more than so many values: saturated
OTHER_RATE = 1.5  # times another log's period
LEAST_SAMPLES = 50


@dataclass(frozen=True)
class Log:
    """One recording.

    Attributes
    ----------
    times_s : ndarray of shape (k,), rising.
    drive : ndarray of shape (k, n_channels), what was commanded, each until the next sample.
    measured : ndarray of shape (k, n_signals), NaN where a sample is missing.
    """

    path: Path
    times_s: np.ndarray
    drive: np.ndarray
    measured: np.ndarray

    @property
    def period_s(self) -> float:
        """The median time between two samples."""
        return float(np.median(np.diff(self.times_s)))


def read_logs(robot: RobotFile) -> tuple[Log, ...]:
    """Read every log that robot.yaml names.

    Raises
    ------
    ValueError
        In one sentence: file, column and row, rule, and what to do.
    """
    logs = tuple(_read(path, robot) for path in robot.logs)
    for log in logs[1:]:
        ratio = log.period_s / logs[0].period_s
        if not 1 / OTHER_RATE < ratio < OTHER_RATE:
            raise ValueError(
                f"{log.path}: a sample every {1e3 * log.period_s:.3g} ms, where "
                f"{logs[0].path.name} has one every {1e3 * logs[0].period_s:.3g} ms; logs of one "
                "folder need one rate: resample, or keep them in a folder each"
            )
    return logs


def columns_of(path: Path) -> pl.DataFrame:
    """Return a log's table, whatever its columns hold."""
    try:
        if path.suffix.lower() in (".csv", ".txt"):
            return pl.read_csv(path, infer_schema_length=None, null_values=["", "nan", "NaN"])
        if path.suffix.lower() == ".parquet":
            return pl.read_parquet(path)
    except (pl.exceptions.PolarsError, OSError) as error:
        why = str(error).splitlines()[0]
        raise ValueError(f"{path}: cannot be read as a table: {why}") from None
    raise ValueError(f"{path}: expected a .csv or a .parquet file")


def _read(path: Path, robot: RobotFile) -> Log:
    table = columns_of(path)
    times_s = _numbers(path, table, robot.time, "time")
    drive = _stacked(path, table, robot.drive)
    measured = _stacked(path, table, robot.measured)
    row = _Rows(path)
    if len(times_s) < LEAST_SAMPLES:
        raise ValueError(f"{path}: {len(times_s)} samples; a log needs at least {LEAST_SAMPLES}")
    row.refuse(~np.isfinite(times_s), lambda i: "no time; every row needs one")
    back = np.r_[False, np.diff(times_s) <= 0]
    row.refuse(
        back,
        lambda i: (
            f"time goes from {times_s[i - 1]:.6g} s to {times_s[i]:.6g} s; it must rise: "
            "drop rows that were written twice, or give the unit of the time"
        ),
    )
    for k, at in enumerate(robot.drive):
        row.refuse(~np.isfinite(drive[:, k]), lambda i, at=at: f"{at.name}: no value is commanded")
    for k, at in enumerate(robot.measured):
        _check(row, robot.model, at, robot.measured[at], times_s, measured[:, k])
    if not any(np.nanstd(one) > 1e-9 for one in measured.T):
        raise ValueError(f"{path}: nothing moves in it; take it out of logs")
    for k, at in enumerate(robot.measured):
        if np.nanmax(measured[:, k]) == np.nanmin(measured[:, k]):
            raise ValueError(
                f"{path}: {at.name} stays at {measured[0, k]:.6g} in all rows, where others move: "
                "a frozen sensor, or the wrong column; take the log or the signal out"
            )
    return Log(path, times_s, drive, measured)


def _stacked(path: Path, table: pl.DataFrame, columns: dict | object) -> np.ndarray:
    items = columns.items()  # type: ignore[attr-defined]
    return np.column_stack([_numbers(path, table, column, at.name) for at, column in items])


def _numbers(path: Path, table: pl.DataFrame, column: Column, what: str) -> np.ndarray:
    if column.name not in table.columns:
        raise ValueError(
            f"{path}: robot.yaml takes {what} from a column {column.name!r}, which the log lacks; "
            f"it has {', '.join(table.columns)}"
        )
    cells = table[column.name]
    values = cells.cast(pl.Float64, strict=False)
    wrong = (values.is_null() & cells.is_not_null()).to_numpy()
    _Rows(path).refuse(wrong, lambda i: f"{column.name}: {cells[i]!r} is no number")
    return values.fill_null(np.nan).to_numpy().astype(float) * column.factor + column.offset


@dataclass(frozen=True)
class _Rows:
    """Names rows of a log as an editor does: the header of a CSV file is line 1."""

    path: Path

    def refuse(self, bad: np.ndarray, say: Callable[[int], str]) -> None:
        if bad.any():
            i = int(np.argmax(bad))
            row = f"line {i + 2}" if self.path.suffix.lower() != ".parquet" else f"row {i + 1}"
            raise ValueError(f"{self.path}, {row}: {say(i)}")


def _check(
    row: _Rows,
    model: mujoco.MjModel,
    at: Signal,
    column: Column,
    times_s: np.ndarray,
    values: np.ndarray,
) -> None:
    if not np.isfinite(values).any():
        raise ValueError(f"{row.path}: {at.name} holds no number; take the log or the signal out")
    unit = at.unit.removesuffix("/s")
    ask = "; is the unit right?"
    if at.kind == "position":
        joint = int(np.flatnonzero(model.jnt_qposadr == at.index)[0])
        least, most = model.jnt_range[joint]
        if model.jnt_limited[joint]:
            out = (values < least - BEYOND[unit]) | (values > most + BEYOND[unit])
            row.refuse(
                out,
                lambda i: (
                    f"{at.name} is {values[i]:.4g} {unit}, far outside of its range of "
                    f"{least:.4g} to {most:.4g} in the model{ask}"
                ),
            )
        with np.errstate(invalid="ignore"):
            speed = np.r_[0.0, np.abs(np.diff(values)) / np.diff(times_s)]
            # a glitch of one sample is noise; a wrong unit shows in how fast it usually moves
            usual = np.nanquantile(speed, 0.9)
        row.refuse(
            (speed > FASTEST[unit]) & (usual > FASTEST[unit] / 10),
            lambda i: f"{at.name} moves at {speed[i]:.4g} {unit}/s; no joint does{ask}",
        )
    elif at.kind == "velocity":
        row.refuse(
            np.abs(values) > FASTEST[unit],
            lambda i: f"{at.name} is {values[i]:.4g} {at.unit}; no joint is so fast{ask}",
        )
    _refuse_saturated(row, at.name, column, values)


def _refuse_saturated(row: _Rows, name: str, column: Column, values: np.ndarray) -> None:
    """Refuse a signal of many values that stays at its least or at its largest one for long."""
    known = values[np.isfinite(values)]
    if len(np.unique(known)) < 2 * PLATEAU:
        return
    for end in (known.min(), known.max()):
        first = _long_run(values == end, PLATEAU)
        if first is not None and (known == end).mean() > 0.02:
            row.refuse(
                np.arange(len(values)) == first,
                lambda i, end=end: (
                    f"{name} stays at {end:.6g}, the end of what column "
                    f"{column.name!r} reaches: a saturated sensor; take the log or the signal out"
                ),
            )


def _long_run(same: np.ndarray, least: int) -> int | None:
    """Return where the first run of at least so many True begins."""
    edges = np.flatnonzero(np.diff(np.r_[False, same, False].astype(int)))
    runs = edges.reshape(-1, 2)
    long = runs[np.diff(runs, axis=1)[:, 0] >= least]
    return int(long[0, 0]) if len(long) else None


def periods(logs: Sequence[Log]) -> float:
    """Return the usual time between two samples [s]."""
    return float(np.median([log.period_s for log in logs]))
