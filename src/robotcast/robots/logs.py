"""Logs of a robot: read, converted to SI units, and checked before anything is simulated."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import mujoco
import numpy as np
import polars as pl

from robotcast.robots.model_fields import Payload
from robotcast.robots.names import Channel, Signal, driven_dof, quaternions, rates
from robotcast.robots.recordings import remarks, tables_of
from robotcast.robots.robot_file import Column, RobotFile
from robotcast.robots.transmission import is_servo

FASTEST = {"rad": 500.0, "m": 50.0}  # per second, between two samples: no joint moves like that
BEYOND = {"rad": 1.0, "m": 0.5}  # outside of a joint's range, or a quarter of that range
SWINGS = {"rad": 8 * np.pi, "m": 20.0}  # to and fro, of a joint without a range
OTHER_UNIT = 3.0  # times what positions say: a velocity in another unit
SMOOTH = 11  # samples over which a rate is averaged
PLATEAU = 20  # equal samples in a row, between fast ones: the sensor stood still, not the joint
SHORT = 4  # equal samples that a turn of the motion may show
STILL = 1.3  # times what neighbouring samples differ by: with less, a signal is noise
PERIODS_S = (1e-5, 1.0)
OTHER_RATE = 1.5  # times another log's period
TURN, SMALL_RAD = 2 * np.pi, 0.5  # most steps are smaller: a turn is the encoder's
NO_UNIT = 0.1  # by how much the length of a quaternion may differ from 1
LEAST_SAMPLES = 50


@dataclass(frozen=True)
class Log:
    """One recording."""

    path: Path
    times_s: np.ndarray  # (k,), rising
    drive: np.ndarray  # (k, n_channels), what was commanded, each until the next sample
    measured: np.ndarray  # (k, n_signals), NaN where a sample is missing
    payloads: tuple[Payload, ...] = ()  # what was fixed to the robot then
    motion: int = 0  # number of the first log of the same motion
    factors: Mapping[str, np.ndarray] = field(default_factory=dict)  # (k,), what else was logged
    number: float = math.inf  # in the order of robot.yaml, from 1; of one to come, after all others

    @property
    def period_s(self) -> float:
        """The median time between two samples."""
        return float(np.median(np.diff(self.times_s)))

    @cached_property
    def _driven(self) -> tuple[np.ndarray, np.ndarray]:
        """Times with the end, (k + 1,), and the integral of the drive up to each."""
        times_s = np.r_[self.times_s, self.times_s[-1] + self.period_s]
        steps = np.diff(times_s)[:, None] * self.drive
        return times_s, np.vstack([np.zeros(self.drive.shape[1]), np.cumsum(steps, axis=0)])

    def slow(self, first: int, end: int) -> dict[str, float]:
        """Return what samples have one value of, all together.

        That is the number of the "log", the "time" into it in their middle [s], and the means of
        what else was logged, as "by_temperature".
        """
        of = {f"by_{name}": float(some[first:end].mean()) for name, some in self.factors.items()}
        time_s = self.times_s[first:end].mean() - self.times_s[0]
        return {"log": self.number, "time": float(time_s), **of}

    def mean_drive(self, edges_s: np.ndarray, delay_s: np.ndarray) -> np.ndarray:
        """Return the means (n, n_channels) between n + 1 edges, every channel so much later."""
        times_s, driven = self._driven
        found = np.empty((len(edges_s) - 1, len(delay_s)))
        for channel, late in enumerate(delay_s):
            at, ends = edges_s - late, self.drive[[0, -1], channel]
            total = np.interp(np.clip(at, times_s[0], times_s[-1]), times_s, driven[:, channel])
            before, after = np.minimum(at - times_s[0], 0), np.maximum(at - times_s[-1], 0)
            total += before * ends[0] + after * ends[1]
            found[:, channel] = np.diff(total) / np.diff(at)
        return found


def read_logs(robot: RobotFile) -> tuple[Log, ...]:
    """Read every log that robot.yaml names, or refuse it in one sentence (ValueError).

    That says file, column and row, rule, and what to do.
    """
    tables = ((path, name, one) for path in robot.logs for name, one in tables_of(path))
    logs = [_read(path.with_name(name), one, robot) for path, name, one in tables]
    paths, motions = [log.path for log in logs], list(range(len(logs)))
    for group in robot.repeats:
        own = {motions[_number(robot, "repeats", paths, name)] for name in group}
        motions = [min(own) if motion in own else motion for motion in motions]
    numbered = enumerate(zip(logs, motions, strict=True), 1)
    logs = [replace(log, motion=motion, number=number) for number, (log, motion) in numbered]
    for name, loads in robot.payloads.items():
        number = _number(robot, "payloads", paths, name)
        logs[number] = replace(logs[number], payloads=(*logs[number].payloads, *loads))
    for log in logs[1:]:
        ratio = log.period_s / logs[0].period_s
        if not 1 / OTHER_RATE < ratio < OTHER_RATE:
            raise ValueError(
                f"{log.path}: a sample every {1e3 * log.period_s:.3g} ms, where "
                f"{logs[0].path.name} has one every {1e3 * logs[0].period_s:.3g} ms; logs of one "
                "folder need one rate: resample, or keep them in a folder each"
            )
    return tuple(logs)


def _number(robot: RobotFile, key: str, paths: Sequence[Path], name: str) -> int:
    """Return which log has a name, which holds as much of its path as tells it from others."""
    parts = Path(name).parts
    found = [k for k, path in enumerate(paths) if path.parts[-len(parts) :] == parts]
    if not found:
        raise ValueError(f"{robot.path}: {key}: {name} is none of the logs")
    if len(found) > 1:
        first, second = (paths[k].relative_to(robot.path.parent).as_posix() for k in found[:2])
        raise ValueError(
            f"{robot.path}: {key}: {name} is {first} as well as {second}; name its folder, too"
        )
    return found[0]


def _read(path: Path, table: pl.DataFrame, robot: RobotFile) -> Log:
    times_s = _numbers(path, table, robot.time, "time")
    drive, measured = (
        np.array([_numbers(path, table, c, at.name) for at, c in some.items()])
        .reshape(len(some), len(times_s))
        .T.copy()
        for some in (robot.drive, robot.measured)
    )
    if len(times_s) < LEAST_SAMPLES:
        raise ValueError(f"{path}: {len(times_s)} samples; a log needs at least {LEAST_SAMPLES}")
    _check_times(path, times_s)
    for at, values in zip(robot.drive, drive.T, strict=True):
        _check_drive(path, robot.model, at, values)
    _run_on(robot, drive, measured)
    _unite(path, robot, measured)
    for (at, column), values in zip(robot.measured.items(), measured.T, strict=True):
        _check(path, robot.model, at, times_s, values)
        own = [
            c for c, channel in enumerate(robot.drive) if driven_dof(robot.model, channel) == at.dof
        ]
        _refuse_stuck(path, at, column, values, drive[:, own or slice(None)])
    _refuse_other_units(path, robot, times_s, measured)
    if not any(_moves(one) for one in measured.T):
        raise ValueError(f"{path}: nothing moves in it; take it out of logs")
    _refuse_frozen(path, robot, drive, measured)
    factors = {
        name: _filled(path, times_s, _numbers(path, table, c, f"factors {name}"), c.name)
        for name, c in robot.factors.items()
    }
    return Log(path, times_s, drive, measured, factors=factors)


def _filled(path: Path, times_s: np.ndarray, values: np.ndarray, name: str) -> np.ndarray:
    """Return a factor between the rows that hold it, since slow things are logged seldom."""
    seen = np.isfinite(values)
    if not seen.any():
        raise ValueError(f"{path}: {name} holds no number; take it out of factors")
    return np.interp(times_s, times_s[seen], values[seen])


def _run_on(robot: RobotFile, drive: np.ndarray, measured: np.ndarray) -> None:
    """Let angles run on where an encoder wraps, and what servos then follow; in place."""
    wrapped = {}
    for at, angle in zip(robot.measured, measured.T, strict=True):
        steps = np.abs(np.diff(angle[np.isfinite(angle)]))
        if at.kind != "position" or at.unit != "rad" or not steps.max(initial=0.0) > TURN / 2:
            continue
        if np.quantile(steps, 0.9) < SMALL_RAD:
            angle[:] = wrapped[at.dof] = _unwrapped(angle)
    for at, wanted in zip(robot.drive, drive.T, strict=True):
        place = wrapped.get(driven_dof(robot.model, at))
        if place is not None and at.actuator is not None and is_servo(robot.model, at.actuator):
            wanted[:] = _unwrapped(wanted)
            wanted -= TURN * np.round(np.nanmedian(wanted - place) / TURN)


def _unwrapped(angle: np.ndarray) -> np.ndarray:
    """Return an angle (k,) without jumps by whole turns."""
    seen, found = np.flatnonzero(np.isfinite(angle)), angle.copy()
    found[seen[1:]] -= TURN * np.cumsum(np.round(np.diff(angle[seen]) / TURN))
    return found


def _unite(path: Path, robot: RobotFile, measured: np.ndarray) -> None:
    """Make quaternions (k, 4) unit ones of a sign that never jumps, in place; refuse others."""
    signals = list(robot.measured)
    for first, _ in quaternions(robot.model):
        at = {one.index: k for k, one in enumerate(signals) if one.kind == "turn"}
        own = [at[first + element] for element in range(4)]
        q = measured[:, own]
        length, name = np.linalg.norm(q, axis=1), signals[own[0]].name
        _refuse(
            path,
            np.abs(length - 1) > NO_UNIT,
            lambda i, name=name, length=length: (
                f"{name} to its z: the quaternion has the length {length[i]:.4g}, where 1 is due"
            ),
        )
        q = q / length[:, None]
        seen = np.flatnonzero(np.isfinite(q).all(axis=1))
        turned_over = (q[seen[1:]] * q[seen[:-1]]).sum(axis=1) < 0
        q[seen[1:]] *= np.where(np.cumsum(turned_over) % 2, -1.0, 1.0)[:, None]
        measured[:, own] = q


def _numbers(path: Path, table: pl.DataFrame, column: Column, what: str) -> np.ndarray:
    if column.name not in table.columns:
        raise ValueError(
            f"{path}: robot.yaml takes {what} from a column {column.name!r}, which the log lacks; "
            f"it has {', '.join(table.columns)}"
        )
    cells = table[column.name]
    values = cells.cast(pl.Float64, strict=False)
    wrong = (values.is_null() & cells.is_not_null()).to_numpy()
    _refuse(path, wrong, lambda i: f"{column.name}: {cells[i]!r} is no number")
    return values.fill_null(np.nan).to_numpy().astype(float) * column.factor + column.offset


def _refuse(path: Path, bad: np.ndarray, say: Callable[[int], str]) -> None:
    """Refuse the first bad row, called as an editor does: a CSV file has a header."""
    if bad.any():
        i = int(np.argmax(bad))
        text = path.suffix.lower() in (".csv", ".txt")
        at = f"line {remarks(path) + i + 2}" if text else f"row {i + 1}"
        raise ValueError(f"{path}, {at}: {say(i)}")


def _check_times(path: Path, times_s: np.ndarray) -> None:
    _refuse(path, ~np.isfinite(times_s), lambda i: "no time; every row needs one")
    _refuse(
        path,
        np.r_[False, np.diff(times_s) <= 0],
        lambda i: (
            f"time goes from {times_s[i - 1]:.6g} s to {times_s[i]:.6g} s; it must rise: "
            "drop rows that were written twice, or give the unit of the time"
        ),
    )
    period_s = float(np.median(np.diff(times_s)))
    if not PERIODS_S[0] < period_s < PERIODS_S[1]:
        raise ValueError(
            f"{path}: a sample every {period_s:.3g} s; no robot is logged like that: is the "
            "unit of the time right?"
        )


def _check_drive(path: Path, model: mujoco.MjModel, at: Channel, values: np.ndarray) -> None:
    _refuse(
        path,
        ~np.isfinite(values),
        lambda i: f"{at.name}: no value is commanded; fill the gap, or cut the log there",
    )
    if at.actuator is None or not model.actuator_ctrllimited[at.actuator]:
        return
    least, most = model.actuator_ctrlrange[at.actuator]
    _refuse(
        path,
        (values < 2 * least - most) | (values > 2 * most - least),
        lambda i: (
            f"{at.name} is commanded {values[i]:.4g}, where the model clips at {least:.4g} and "
            f"{most:.4g}; is the unit right? If so, widen its ctrlrange"
        ),
    )


def _check(
    path: Path, model: mujoco.MjModel, at: Signal, times_s: np.ndarray, values: np.ndarray
) -> None:
    if not np.isfinite(values).any():
        raise ValueError(f"{path}: {at.name} holds no number; take the log or the signal out")
    unit, ask = at.unit.removesuffix("/s"), "; is the unit right?"
    if at.kind == "velocity":
        _refuse(
            path,
            np.abs(values) > FASTEST[unit],
            lambda i: f"{at.name} is {values[i]:.4g} {at.unit}; no joint is so fast{ask}",
        )
    if at.kind != "position":
        return
    joint = int(model.dof_jntid[at.dof])
    least, most = model.jnt_range[joint]
    if model.jnt_limited[joint]:
        beyond = max(BEYOND[unit], 0.25 * (most - least))  # a limit gives way a little
        _refuse(
            path,
            (values < least - beyond) | (values > most + beyond),
            lambda i: (
                f"{at.name} is {values[i]:.4g} {unit}, far outside of its range of "
                f"{least:.4g} to {most:.4g} in the model{ask}"
            ),
        )
    elif not at.element:  # nobody knows how far a free body may go
        known = _known(values)
        to_and_fro = np.ptp(known) > max(SWINGS[unit], 1.5 * abs(known[-1] - known[0]))
        _refuse(
            path,
            to_and_fro & (np.abs(values - known[0]) > SWINGS[unit]),
            lambda i: (
                f"{at.name} is {values[i]:.4g} {unit}, and it comes back{ask} If it does "
                "move so far, give the joint a range in the model"
            ),
        )
    with np.errstate(invalid="ignore"):
        speed = np.r_[0.0, np.abs(np.diff(values)) / np.diff(times_s)]
        # a glitch of one sample is noise; a wrong unit shows in how fast it usually moves
        usual = np.nanquantile(speed, 0.9)
    _refuse(
        path,
        (speed > FASTEST[unit]) & (usual > FASTEST[unit] / 10),
        lambda i: f"{at.name} moves at {speed[i]:.4g} {unit}/s; no joint does{ask}",
    )


def _refuse_other_units(
    path: Path, robot: RobotFile, times_s: np.ndarray, measured: np.ndarray
) -> None:
    """Refuse velocities that are far from what the positions of the same joint say."""
    signals = list(zip(robot.measured, measured.T, strict=True))
    place = {at.dof: values for at, values in signals if at.kind == "position"}
    poses = np.zeros((1, len(times_s), robot.model.nq))
    for at, values in signals:
        if at.kind == "turn":
            poses[0, :, at.index] = values
    turns = rates(robot.model, poses, float(np.median(np.diff(times_s))))[0]
    for at, speed in signals:
        if at.kind != "velocity" or not (at.dof in place or at.element):
            continue
        rate = np.gradient(place[at.dof], times_s) if at.dof in place else turns[:, at.dof]
        seen = np.isfinite(rate) & np.isfinite(speed)
        if not seen.any() or not (np.ptp(rate[seen]) and np.ptp(speed[seen])):
            continue
        slope = np.sqrt(np.mean(rate[seen] ** 2) / np.mean(speed[seen] ** 2))
        alike = np.corrcoef(rate[seen], speed[seen])[0, 1]
        if at.element and _apart(rate[seen], speed[seen]):
            raise ValueError(
                f"{path}: {at.name} does not go with the pose: [0] to [2] of a free joint are "
                "along the axes of the world, the last three are about those of the body"
            )
        if abs(alike) > 0.8 and not 1 / OTHER_UNIT < slope < OTHER_UNIT:
            raise ValueError(
                f"{path}: the position moves {slope:.3g} times as fast as {at.name} says; one of "
                "the two units is wrong (deg is 57.3 times rad, rad/s 9.55 times rpm)"
            )


def _apart(rate: np.ndarray, speed: np.ndarray) -> bool:
    """Tell whether two rates (k,) are others even where noise is averaged out."""
    smooth, own = (np.convolve(one, np.ones(SMOOTH) / SMOOTH, "valid") for one in (rate, speed))
    noise = np.sqrt(np.mean(np.diff(rate) ** 2) / 2 / SMOOTH)
    moves = min(smooth.std(), own.std()) > OTHER_UNIT * noise
    return bool(moves and np.corrcoef(smooth, own)[0, 1] < 0.5)


def _refuse_stuck(
    path: Path, at: Signal, column: Column, values: np.ndarray, commands: np.ndarray
) -> None:
    """Refuse runs of equal samples between fast ones: no joint stops and starts like that.

    A joint may stick, or rest as its `commands` (k, n) do: then it sets out again from where it
    was. A sensor that froze jumps to where the joint has got to; or joint and commands move on, and
    it stops and starts as fast as the joint usually moves. A velocity is refused at the ends of
    what it reaches alone.
    """
    known = _known(values)
    steps = np.abs(np.diff(values, prepend=np.nan, append=np.nan))
    moved = steps[steps > 0]
    if at.element or len(np.unique(known)) < 2 * PLATEAU or not len(moved):
        return  # a free body may lie until it is hit
    usual, most = np.quantile(moved, [0.5, 0.95])
    fast = max(0.3 * usual, 4 * np.quantile(moved, 0.01))
    ends, stops = (known.min(), known.max()), []
    for first, end in _runs(steps[1:-1] == 0):
        # of the steps into a run and out of it the first may be a part of one; they are NaN at
        # the ends of a log, where a robot may rest
        into, out = steps[max(first - 1, 0) : first + 1].max(), steps[end + 1 : end + 3].max()
        if end - first > SHORT and not (into <= fast or out <= fast):
            stops.append((first, end, into, out))
    for first, end, into, out in stops:
        value, n = values[first], end - first + 1
        if np.isnan(into + out):
            continue
        if value in ends:
            n = sum(e - f + 1 for f, e, *_ in stops if values[f] == value)
        elif at.kind != "position":
            continue
        else:
            driven = np.diff(commands[first : end + 1], axis=0).any(axis=1).mean() > 0.5
            if not (out > most or (driven and min(into, out) > usual)):
                continue
        if n >= PLATEAU:
            why = f"the end of what column {column.name!r} reaches: a saturated"
            why = why if value in ends else "a frozen"
            _refuse(
                path,
                np.arange(len(values)) == first,
                lambda i, why=why, n=n: (
                    f"{at.name} stays at {values[i]:.6g} for {n} samples amid a motion, {why} "
                    "sensor; take the log or the signal out, or leave these cells empty"
                ),
            )


def _refuse_frozen(path: Path, robot: RobotFile, drive: np.ndarray, measured: np.ndarray) -> None:
    """Refuse a joint that never moves although it is driven, or hangs on others that move."""
    for at, values in zip(robot.measured, measured.T, strict=True):
        if at.element or np.ptp(_known(values)) > 0:
            continue
        driven = [driven_dof(robot.model, channel) for channel in robot.drive]
        own = [c for c, dof in enumerate(driven) if dof is not None and dof == at.dof]
        if not own or np.ptp(drive[:, own], axis=0).any():
            raise ValueError(
                f"{path}: {at.name} stays at {_known(values)[0]:.6g} in all rows, where "
                f"{'it is driven' if own else 'others move'}: a frozen sensor, or the wrong "
                "column; take the log or the signal out"
            )


def _moves(values: np.ndarray) -> bool:
    """Tell a motion from noise, of which neighbouring samples differ as much as distant ones."""
    steps = np.diff(_known(values))
    return float(_known(values).std()) > STILL * float(np.sqrt(np.mean(steps**2) / 2)) + 1e-12


def _known(values: np.ndarray) -> np.ndarray:
    return values[np.isfinite(values)]


def _runs(same: np.ndarray) -> np.ndarray:
    """Return the first and the end of every run of True, (n, 2)."""
    return np.flatnonzero(np.diff(np.r_[False, same, False].astype(int))).reshape(-1, 2)


def periods(logs: Sequence[Log]) -> float:
    """Return the usual time between two samples [s]."""
    return float(np.median([log.period_s for log in logs]))
