"""Windows of logs: where each starts, in which state, how well that is known, and what is noise.

A model is asked to predict from a measured state, for as long as a prediction holds. The state is
taken from the samples about the start, without any model: a local cubic through measured positions
and velocities, weighed by their noise, whose covariance says how far the true state may lie from
it. That much a fit may move it, and no further.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from robotcast.robots.logs import Log, periods
from robotcast.robots.names import (
    Signal,
    coordinates,
    driven_dof,
    moved,
    quaternions,
    rate_of_turn,
    spin,
    turn,
    turning,
)
from robotcast.robots.robot_file import RobotFile
from robotcast.robots.transmission import control_ends, is_plain, rotor_inertia

ABOUT_S, ABOUT_SAMPLES = 0.02, 4  # on either side of a start: what tells its state
LEAST_SAMPLES = 12  # of a window
LATEST_S = 0.1  # by which an encoder may show late
CUBIC = 4
PART = 0.02  # of how far a signal moves: what is missed by so much counts as one
Signals = list[tuple[bool, np.ndarray, float]]  # of a joint: a rate or not, values, noise
GROUPS = 12  # parts that can be held out, at least: where logs are fewer, each is cut


@dataclass(frozen=True)
class Window:
    """A part of a log that starts from a measured state."""

    log: int  # index
    first: int  # its samples are log[first:end]
    end: int
    part: int  # windows of one part are held out together
    qpos: np.ndarray  # (nq,), the state at its start
    qvel: np.ndarray  # (nv,)
    start_sd: np.ndarray  # standard deviations of positions and velocities there, (2, nv)
    # acceleration and its rate there, (2, nv), drawn in to 0 as far as noise makes them up
    bends: np.ndarray
    bends_sd: np.ndarray  # and their deviations
    track: "Track"  # as measured; a late encoder shows there where its joint was


@dataclass(frozen=True)
class Track:
    """Positions and velocities (…, nv) by the time since a start, from where `turns` count."""

    path: CubicHermiteSpline
    turns: tuple[int, ...]  # first degrees of freedom of those that turn a quaternion

    def __call__(self, since_s: np.ndarray | float, order: int) -> np.ndarray:
        found = self.path(since_s, order)
        for dof in self.turns if order else ():
            by, own = self.path(since_s)[..., dof : dof + 3], slice(dof, dof + 3)
            found[..., own] = spin(by, found[..., own])
        return found


@dataclass(frozen=True)
class Units:
    """What the signals are divided by, their noise in these units, and what they weigh.

    All of shape (n_signals,); one of another weight is one in units as much larger.
    """

    si: np.ndarray
    noise: np.ndarray
    weight: np.ndarray

    @classmethod
    def of(
        cls,
        signals: Sequence[Signal],
        logs: Sequence[Log],
        windows: Sequence[Window],
        noise: np.ndarray,
    ) -> "Units":
        """Take them from how far the signals move within the windows."""
        squares = []
        for w in windows:
            some = logs[w.log].measured[w.first : w.end]
            squares.append(np.nanmean((some - np.nanmean(some, axis=0)) ** 2, axis=0))
        travel = np.sqrt(np.nanmean(squares, axis=0))
        travel = of_quaternions(signals, np.where(travel > 0, travel, travel.max()))
        si = np.hypot(noise, PART * travel)
        return cls(si, noise / si, np.ones(len(si)))

    def weighing(self, some: np.ndarray, floor: np.ndarray) -> "Units":
        """Return units in which some signals, (n_signals,) bool, weigh as much as all others.

        Each by how far it is from its own floor, (n_signals,) in these units.
        """
        weight = np.where(some, 1.0, np.sqrt(some.sum() / (~some).sum())) / floor
        return Units(self.si / weight, self.noise * weight, weight)


def of_quaternions(signals: Sequence[Signal], travel: np.ndarray) -> np.ndarray:
    """Return how far signals move, (n_signals,), the elements of a quaternion as one."""
    found = travel.copy()
    for dof in {at.dof for at in signals if at.kind == "turn"}:
        own = [at.kind == "turn" and at.dof == dof for at in signals]
        found[own] = np.sqrt(np.mean(travel[own] ** 2))
    return found


def noise_of(robot: RobotFile, logs: Sequence[Log]) -> np.ndarray:
    """Return the noise of every signal in SI units, (n_signals,): as given, or as the logs show it.

    Third differences of neighbouring samples cancel what is smooth and leave √20 times white
    noise (Gasser, Sroka and Jennen-Steinmetz 1986 use second ones). Where quantisation hides it,
    the step over √12 stands for it. Noise that a driver has smoothed is not seen.
    """
    found = []
    for k, column in enumerate(robot.measured.values()):
        if column.noise is not None:
            found.append(column.noise)
            continue
        steps, third = (
            np.abs(np.concatenate([np.diff(log.measured[:, k], n) for log in logs])) for n in (1, 3)
        )
        steps, third = steps[np.isfinite(steps) & (steps > 0)], third[np.isfinite(third)]
        quantum = float(np.quantile(steps, 0.01)) if len(steps) else 0.0
        white = float(np.median(third)) / 0.6745 / np.sqrt(20.0) if len(third) else 0.0
        travel = float(np.nanstd(np.concatenate([log.measured[:, k] for log in logs])))
        found.append(max(white, min(quantum, travel) / np.sqrt(12.0), 1e-6 * travel))
    return np.array(found)


class StartStates:
    """Takes the state at a time from the samples about it."""

    def __init__(self, robot: RobotFile, logs: Sequence[Log], noise: np.ndarray) -> None:
        self.robot, self.logs, self.noise = robot, logs, noise
        # how many samples before and after a start are looked at
        self.margin = max(ABOUT_SAMPLES, round(ABOUT_S / periods(logs)))
        self._turns = {at.index: k for k, at in enumerate(robot.measured) if at.kind == "turn"}
        self._pushes = self._accelerates()
        ends = [control_ends(robot.model, at.actuator) for at in robot.drive]
        self._ends = np.reshape(ends, (-1, 2)).T

    def _accelerates(self) -> dict[int, np.ndarray]:
        """Return by how much commands (n_channels,) accelerate the rotor of a joint's drive.

        Of those that the model delays or whose force it limits, nobody knows when or by how much.
        """
        model, found = self.robot.model, {}
        for channel, at in enumerate(self.robot.drive):
            dof, a, force = driven_dof(model, at), at.actuator, 1.0
            if a is not None:
                limited = model.actuator_forcelimited[a] or model.actuator_delay[a]
                force = float(model.actuator_gear[a, 0] * model.actuator_gainprm[a, 0])
                force *= is_plain(model, a) and not limited
            if dof is not None:
                rotor = rotor_inertia(model, [dof], model.dof_armature[[dof]])[0]
                own = found.setdefault(dof, np.zeros(len(self.robot.drive)))
                own[channel] = force / rotor
        return found

    def at(self, log: int, first: int) -> tuple[np.ndarray, ...] | None:
        """Return qpos (nq,), qvel (nv,) and their deviations (2, nv); None where samples lack."""
        model, near = self.robot.model, self.logs[log].measured[self._about(first)]
        fits = self._fits(log, first, {})
        if fits is None:
            return None
        known, sd = fits
        qpos = model.qpos0.copy()
        qpos[coordinates(model)[~turning(model)]] = 0.0
        for index, k in self._turns.items():
            qpos[index] = near[self.margin, k]
        qpos = moved(model, qpos[None], known[:1])[0]
        closes = self.robot.followers.settle(qpos, known[1])
        return (qpos, known[1], sd[:2]) if closes else None

    def bends(self, log: int, first: int) -> tuple[np.ndarray, np.ndarray]:
        """Return acceleration and its rate where there is a state, and their deviations, (2, nv).

        They are those of a rotor at which the drive pushes anew with every command, and all else
        smoothly.
        """
        commands = np.clip(self.logs[log].drive[self._about(first)], *self._ends)
        pushed = {dof: commands @ own for dof, own in self._pushes.items()}
        fits = self._fits(log, first, pushed)
        assert fits is not None
        known, sd = fits
        for dof, own in pushed.items():
            known[2, dof] += own[self.margin]
        return known[2:], sd[2:]

    def _about(self, first: int) -> slice:
        return slice(first - self.margin, first + self.margin + 1)

    def _fits(
        self, log: int, first: int, pushed: Mapping[int, np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Return values with three derivatives and deviations, (4, nv); None where samples lack.

        What joints are `pushed` by at every sample is left out of their motion.
        """
        some, rows = self.logs[log], self._about(first)
        if rows.start < 0 or rows.stop > len(some.times_s):
            return None
        since_s = some.times_s[rows] - some.times_s[first]
        known, sd = np.zeros((2, CUBIC, self.robot.model.nv))
        for dof, signals in self._seen(some.measured[rows]).items():
            if dof in pushed:
                signals = _without(since_s, pushed[dof], signals)
            fitted = _fitted(since_s, signals)
            if fitted is None:
                return None
            known[:, dof], sd[:, dof] = fitted
        return known, sd

    def track(self, log: int, first: int) -> "Track":
        """Return positions (nv,) by the time since a sample: through states a margin apart."""
        times_s, model = self.logs[log].times_s, self.robot.model
        at_s, found = [], []
        for row in range(first, len(times_s), self.margin):
            since_s = times_s[row] - times_s[first]
            if since_s >= 0.99 * LATEST_S or (state := self.at(log, row)) is None:
                break
            at_s.append(since_s)
            found.append(state[:2])
        states, qvel = (np.array(some) for some in zip(*found, strict=True))
        qpos = states[:, coordinates(model)]
        turns = tuple(dof for _, dof in quaternions(model))
        for index, dof in quaternions(model):
            q, own = states[:, index : index + 4], slice(dof, dof + 3)
            qpos[:, own] = turn(q[0], q)
            qvel[:, own] = rate_of_turn(qpos[:, own], qvel[:, own])
        end = qpos[-1] + (LATEST_S - at_s[-1]) * qvel[-1]
        spline = CubicHermiteSpline(
            [*at_s, LATEST_S], np.vstack([qpos, end]), np.vstack([qvel, qvel[-1]])
        )
        return Track(spline, turns)

    def _seen(self, near: np.ndarray) -> dict[int, Signals]:
        """Return what samples (n, n_signals) say of every dof: a rate or not, values, noise.

        Turns count from the sample in the middle.
        """
        follow = {*self.robot.followers.dofs}
        found = {dof: [] for dof in range(self.robot.model.nv) if dof not in follow}
        for k, at in enumerate(self.robot.measured):
            if at.dof in found and at.kind != "turn":
                found[at.dof].append((at.kind == "velocity", near[:, k], self.noise[k]))
        for index, dof in quaternions(self.robot.model):
            own = [self._turns[index + element] for element in range(4)]
            turns = turn(near[self.margin, own], near[:, own])
            noise = 2 * float(np.sqrt(np.mean(self.noise[own] ** 2)))
            for axis in range(3):
                found[dof + axis].append((False, turns[:, axis], noise))
        return found


def _fitted(since_s: np.ndarray, signals: Signals) -> tuple[np.ndarray, np.ndarray] | None:
    """Fit one cubic to the positions and its slope to the velocities of a degree of freedom.

    Return the value and its three derivatives, and their deviations.
    """
    span = since_s[-1]
    tau, powers = since_s / span, np.arange(CUBIC)
    parts, targets = [], []
    for is_rate, values, noise in signals:
        seen = np.isfinite(values)
        basis = tau[:, None] ** powers
        if is_rate:
            basis = powers * tau[:, None] ** np.maximum(powers - 1, 0) / span
        parts.append((basis / noise)[seen])
        targets.append((values / noise)[seen])
    design, target = np.vstack(parts), np.concatenate(targets)
    if len(target) < CUBIC + 2 or np.linalg.matrix_rank(design) < CUBIC:
        return None
    found = np.linalg.lstsq(design, target, rcond=None)[0]
    left = float(((target - design @ found) ** 2).sum() / (len(target) - CUBIC))
    sd = np.sqrt(np.diag(np.linalg.inv(design.T @ design)) * max(1.0, left))
    derivative = np.array([1.0, 1.0, 2.0, 6.0]) / span**powers
    return found * derivative, sd * derivative


def _without(since_s: np.ndarray, pushed: np.ndarray, signals: Signals) -> Signals:
    """Return signals less a motion from the middle on, by accelerations (n,) that are held."""
    steps, mid = np.diff(since_s), len(since_s) // 2
    rate = np.r_[0.0, np.cumsum(pushed[:-1] * steps)]
    rate -= rate[mid]
    path = np.r_[0.0, np.cumsum((rate[1:] + rate[:-1]) / 2 * steps)]
    path -= path[mid]
    return [(is_rate, v - (rate if is_rate else path), noise) for is_rate, v, noise in signals]


def cut(
    robot: RobotFile, logs: Sequence[Log], starts: StartStates, length_s: float
) -> tuple[Window, ...]:
    """Cut all logs into windows of a length, evenly spread, and those into parts to hold out.

    Windows of one log are one part, so that nothing held out is seen through its neighbour.
    Where logs are too few for that, each is cut into several parts of consecutive windows.
    """
    n = max(LEAST_SAMPLES, round(length_s / periods(logs)))
    places = [
        (index, first)
        for index, log in enumerate(logs)
        for first in range(starts.margin, len(log.times_s) - n, n)
        if _unbroken(log.times_s[first : first + n + 1])
    ]
    if not places:
        raise ValueError(
            f"{robot.path}: no window of {length_s:.3g} s fits into the logs; give a shorter "
            "windows: length_s"
        )
    if len(places) > robot.most_windows:
        keep = np.linspace(0, len(places) - 1, robot.most_windows).round().astype(int)
        places = [places[i] for i in np.unique(keep)]
    if found := windows_at(starts, places, n):
        return found
    raise ValueError(
        f"{robot.path}: too many samples are missing where windows would start, or the model's "
        "equalities cannot be met there"
    )


def windows_at(
    starts: StartStates, places: Sequence[tuple[int, int]], n: int
) -> tuple[Window, ...]:
    """Return the windows of n samples that start at places, log and sample, with a known state."""
    parts = _parts(starts.logs, places)
    states = [starts.at(index, first) for index, first in places]
    known = [(*place, part, s) for place, part, s in zip(places, parts, states, strict=True) if s]
    if not known:
        return ()
    found = [starts.bends(index, first) for index, first, *_ in known]
    bends, noise = (np.array(some) for some in zip(*found, strict=True))
    true = 1 - (noise**2).mean(axis=0) / np.maximum((bends**2).mean(axis=0), 1e-30)
    shrunk = bends * np.maximum(true, 0.0)
    found = []
    rows = zip(known, shrunk, noise, strict=True)
    for (log, first, part, (qpos, qvel, sd)), bend, its_sd in rows:
        track = starts.track(log, first)
        found.append(Window(log, first, first + n, part, qpos, qvel, sd, bend, its_sd, track))
    return tuple(found)


def _unbroken(times_s: np.ndarray) -> bool:
    gaps = np.diff(times_s)
    return bool(gaps.max() < 10 * np.median(gaps))


def _parts(logs: Sequence[Log], places: Sequence[tuple[int, int]]) -> list[int]:
    """Return the part of every window: its log, or a run of windows of it; of repeats, one."""
    owner = [logs[index].motion for index, _ in places]
    n_owners = len(set(owner))
    runs = 1 if n_owners >= GROUPS else -(-GROUPS // n_owners)
    parts, numbers = [], {}
    for index, (log, first) in zip(owner, places, strict=True):
        of_log = [f for i, f in places if i == log]
        run = of_log.index(first) * min(runs, len(of_log)) // len(of_log)
        parts.append(numbers.setdefault((index, run), len(numbers)))
    return parts
