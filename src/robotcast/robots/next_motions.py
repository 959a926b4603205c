"""Motions that a robot could be logged in next, and the commands of those that would tell most.

Each is simulated with the model as it is from where the logs begin, and only offered if it stays
within the joints' ranges, or a little beyond where the logs have been, and is no faster than twice
the logs. A mass on one of the last links is varied too: it parts what depends on load, on inertia
and on speed.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import polars as pl

from robotcast.diagnosis.next_trials import Further
from robotcast.files import atomic_file
from robotcast.robots.logs import Log, periods
from robotcast.robots.model_fields import Payload, loaded
from robotcast.robots.names import driven_dof, names_of
from robotcast.robots.robot_file import RobotFile
from robotcast.robots.robot_model import RobotModel
from robotcast.robots.sizes import Sizes
from robotcast.robots.windows import StartStates, windows_at

LENGTH_S = 6.0
RATES = (0.3, 1.0, 3.0)  # times what the joint usually moves at
AMPLITUDES = (0.3, 0.6, 1.0)  # of half of what was commanded
SHARES = (0.0, 0.25, 1.0)  # of a link's own mass, that is fixed to it
REPLAYED = 3  # logs, and as many drives at most, one at a time
WIDER, FASTER = 0.5, 2.0  # than the logs, of their range and of their fastest
APART = 8  # samples over which a speed is taken


@dataclass(frozen=True)
class Motion:
    """One motion, as it is told, with its commands (k, n_channels) and what it moves like."""

    told: dict[str, Any]
    log: Log


@dataclass(frozen=True)
class Motions:
    """All that were found feasible; `further` is what the diagnosis chooses from."""

    robot: RobotFile
    some: tuple[Motion, ...]
    further: Further

    def rows(self, chosen: Sequence[dict[str, Any]], folder: Path) -> list[dict[str, Any]]:
        """Return the chosen trials as they are told; write the commands of each."""
        rows = []
        for number, row in enumerate(chosen, 1):
            motion = self.some[int(row["motion"])]
            told = {**motion.told, **{k: v for k, v in row.items() if k != "motion"}}
            file = f"motion_{number}.csv"
            self._write(motion.log, folder / file)
            rows.append({"file": file, **told})
        return rows

    def _write(self, log: Log, path: Path) -> None:
        """Write time, commands and predicted signals in the columns and units of the logs."""
        robot = self.robot
        columns = {robot.time.name: (log.times_s - robot.time.offset) / robot.time.factor}
        for some, values in ((robot.drive, log.drive), (robot.measured, log.measured)):
            for column, own in zip(some.values(), values.T, strict=True):
                columns[column.name] = (own - column.offset) / column.factor
        with atomic_file(path) as temporary:
            pl.DataFrame(columns).write_csv(temporary)


def motions(
    robot: RobotFile, model: RobotModel, sizes: Sizes, length_s: float, noise: np.ndarray
) -> Motions:
    """Return the motions from which the next ones are chosen, each a window in its middle."""
    some, logs = [], model.rollout.logs
    fastest = FASTER * np.max([_fastest(log) for log in logs], axis=0)
    for number, (told, loads, drive, log) in enumerate(_tried(robot, sizes, logs)):
        path = Path(f"motion {number}")
        moved = _moved(robot, loads, drive, log, periods(logs), path)
        if _feasible(robot, sizes, moved, fastest):
            some.append(Motion(told, replace(moved, motion=len(some))))
    if not some:
        return Motions(robot, (), Further(model, ()))
    made = [one.log for one in some]
    starts, n = StartStates(robot, made, noise), round(length_s / periods(made))
    middles = [(len(log.times_s) - n) // 2 for log in made]
    windows = windows_at(starts, [(k, max(starts.margin, at)) for k, at in enumerate(middles)], n)
    simulated = RobotModel(
        robot, made, windows, noise, model.known, model.rollout.threads, model.units
    )
    simulated.effects = model.effects  # and what will be added to them
    nowhere = [
        replace(
            record, measured=np.full_like(record.measured, np.nan), factors={"motion": window.log}
        )
        for record, window in zip(simulated.records, windows, strict=True)
    ]
    return Motions(robot, tuple(some), Further(simulated, tuple(nowhere)))


def _tried(
    robot: RobotFile, sizes: Sizes, logs: Sequence[Log]
) -> Iterator[tuple[dict[str, Any], tuple[Payload, ...], np.ndarray, Log]]:
    """Yield what is told of a motion, its payloads, its commands, and the log it begins as."""
    model, channels = robot.model, list(robot.drive)
    bodies = [int(b) for b in np.unique(model.dof_bodyid)]
    leaves = [b for b in bodies if b not in model.body_parentid[bodies]][:2]
    names, period_s = names_of(model, "body"), periods(logs)
    if not channels:  # what moves by itself cannot be told how
        return
    hung = [(leaf, s * float(model.body_mass[leaf])) for leaf in leaves for s in SHARES[1:]]
    for body, mass_kg in [(0, 0.0), *hung]:
        place = model.body_ipos[body]
        own = (Payload(body, mass_kg, (place[0], place[1], place[2])),) if mass_kg else ()
        weight = {"payload_kg": mass_kg, "fixed_to": names[body] if mass_kg else "–"}
        for log, share in product(logs[:REPLAYED], AMPLITUDES[1:]):
            if share == 1.0 and not own:
                continue  # that was logged
            k = min(len(log.times_s), round(LENGTH_S / period_s))
            middle = np.median(log.drive, axis=0)
            drive = middle + share * (log.drive[:k] - middle)
            size = f"{100 * share:.0f} %"
            name = log.path.relative_to(robot.path.parent).as_posix()
            told = {"motion": f"{name} again", "size": size, "hertz": None}
            yield told | weight, own, drive, log
        for c, rate, share in product(range(min(len(channels), REPLAYED)), RATES, AMPLITUDES):
            usual, dof = sizes.speed / sizes.position / (2 * np.pi), driven_dof(model, channels[c])
            hertz = rate * float(np.median(usual) if dof is None else usual[dof])
            middle, half = _commanded(model, channels[c].actuator, [g.drive[:, c] for g in logs])
            times_s = period_s * np.arange(round(LENGTH_S / period_s))
            drive = np.tile(np.median(logs[0].drive, axis=0), (len(times_s), 1))
            drive[:, c] = middle + share * half * np.sin(2 * np.pi * hertz * times_s)
            column = list(robot.drive.values())[c]
            size = f"{share * half / abs(column.factor):.3g} {column.unit or channels[c].unit}"
            told = {"motion": f"sine on {channels[c].name}", "size": size.strip(), "hertz": hertz}
            yield told | weight, own, drive, logs[0]


def _commanded(
    model: mujoco.MjModel, actuator: int | None, values: Sequence[np.ndarray]
) -> tuple[float, float]:
    """Return the middle of what was commanded and half of its range, within what can be."""
    low, high = float(min(v.min() for v in values)), float(max(v.max() for v in values))
    if actuator is not None and model.actuator_ctrllimited[actuator]:
        low, high = np.clip((low, high), *model.actuator_ctrlrange[actuator])
    return (low + high) / 2, (high - low) / 2


def _moved(
    robot: RobotFile,
    payloads: tuple[Payload, ...],
    drive: np.ndarray,
    log: Log,
    period_s: float,
    path: Path,
) -> Log:
    """Simulate commands from where a log begins, at rest."""
    model = loaded(robot.model, payloads) if payloads else robot.model
    data, signals = mujoco.MjData(model), list(robot.measured)
    for at, values in zip(signals, log.measured.T, strict=True):
        if at.kind in ("position", "turn"):
            data.qpos[at.index] = values[np.isfinite(values)][0]
    robot.followers.settle(data.qpos, data.qvel)
    times_s = period_s * np.arange(len(drive))
    steps = np.diff(np.round(times_s / model.opt.timestep).astype(int), append=0)
    seen = np.full((len(drive), len(signals)), np.nan)
    from_data = {"velocity": data.qvel, "sensor": data.sensordata}
    for row, command, n in zip(seen, drive, steps.tolist(), strict=True):
        for at, value in zip(robot.drive, command, strict=True):
            if at.actuator is not None:
                data.ctrl[at.actuator] = value
            else:
                data.qfrc_applied[at.dof] = value
        row[:] = [from_data.get(at.kind, data.qpos)[at.index] for at in signals]
        if n > 0:  # the last command is never held
            mujoco.mj_step(model, data, n)
    usual = {name: np.full(len(drive), values.mean()) for name, values in log.factors.items()}
    return Log(path, times_s, drive, seen, payloads, factors=usual)


def _fastest(log: Log) -> np.ndarray:
    """Return how fast every signal moves at most, (n_signals,), over samples apart, not noise."""
    moved = np.abs(log.measured[APART:] - log.measured[:-APART])
    return np.nanmax(moved / (log.times_s[APART:] - log.times_s[:-APART])[:, None], axis=0)


def _feasible(robot: RobotFile, sizes: Sizes, log: Log, fastest: np.ndarray) -> bool:
    """Tell whether joints stay where they may be, and move no faster than they may."""
    model, joints = robot.model, robot.model.dof_jntid
    wide = WIDER * (sizes.highest - sizes.lowest)
    limited = model.jnt_limited[joints].astype(bool)
    low = np.where(limited, model.jnt_range[joints, 0], sizes.lowest - wide)
    high = np.where(limited, model.jnt_range[joints, 1], sizes.highest + wide)
    if not np.isfinite(log.measured).all():
        return False
    places = [(k, at) for k, at in enumerate(robot.measured) if at.kind in ("position", "turn")]
    turns = [k for k, at in places if at.kind == "turn"]
    bounds, reached = fastest.copy(), _fastest(log)
    bounds[turns] = bounds[turns].max(initial=0.0)  # elements of one quaternion
    for k, at in places:
        path = log.measured[:, k]
        inside = at.kind == "turn" or (low[at.dof] <= path.min() and path.max() <= high[at.dof])
        if not inside or reached[k] > bounds[k]:
            return False
    return True
