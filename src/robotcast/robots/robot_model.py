"""A robot's model and its logs as diagnosis sees them.

What a signal is off by counts in units of its own: a fiftieth of how far it usually moves, and its
noise. The start state of a window is known only as well as the sensors tell it, so it is fitted:
by one linear step towards the measured signals, of the slopes of the nominal model, held by what
the samples about the start allow. It never moves by more than three of their deviations, so that no
model can hide what it misses in it.
"""

from collections.abc import Iterable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from robotcast.diagnosis.model import Record
from robotcast.fitting.parameter import Parameter
from robotcast.robots.effect import RobotEffect
from robotcast.robots.logs import Log
from robotcast.robots.names import moved, turning
from robotcast.robots.robot_file import RobotFile
from robotcast.robots.rollout import Rollout
from robotcast.robots.transmission import ElasticJoint
from robotcast.robots.windows import PART, Units, Window

MOST_SD = 3.0  # standard deviations that a start state may move by
FEW_ELASTIC = 2  # joints whose twist at the start is fitted, by two runs more for each
FINER = 5  # into how many parts a step is cut to see what it errs by
DRAWS = 20  # of noise, for what it leaves of a perfect model
TRIED = 4  # of starts, for what their slopes leave


@dataclass(frozen=True)
class Step:
    """What the logs tell of the model's step (see `robotcast.robots.floor`)."""

    # by how much one as short as can be moves predictions, (n_windows, k, d); None for its own
    shift: np.ndarray | None = None
    left: float = 1.0  # the part of what the own step errs by that predictions then err by

    def scaled(self, by: np.ndarray) -> "Step":
        """Return the same in other units, `by` times as small (d,)."""
        return Step(None if self.shift is None else self.shift * by, self.left)


@dataclass(frozen=True)
class Known:
    """A model by which windows are cut and noise is judged: its effects, all values (n,)."""

    effects: tuple[RobotEffect, ...]
    values: np.ndarray
    # whether bodies that turn freely may start where it says that they did
    leads: bool = True

    @classmethod
    def nominal(cls, robot: RobotFile) -> "Known":
        """Return the model as it is."""
        return cls((), np.array([p.nominal for p in tuned_parameters(robot)], float))


class RobotModel:
    """Predicts the signals of windows; a `robotcast.diagnosis.model.Model`."""

    error_unit = "% of the usual motion"

    def __init__(
        self,
        robot: RobotFile,
        logs: Sequence[Log],
        windows: Sequence[Window],
        noise: np.ndarray,
        known: Known,
        threads: int = 0,
        units: Units | None = None,
    ) -> None:
        self.effects: dict[str, RobotEffect] = {}
        self.known = known
        self.parameters = tuned_parameters(robot)
        self.units = units or Units.of(list(robot.measured), logs, windows, noise)
        # how many units a signal without noise moves by, all signals together
        self.scale = float(np.linalg.norm(self.units.weight) / PART)
        self.rollout = Rollout(robot, logs, windows, threads)
        self.step = Step()
        self._gains: dict[tuple[int, bytes], tuple[np.ndarray, np.ndarray]] = {}

    @cached_property
    def records(self) -> tuple[Record, ...]:
        """One record a window, numbered from 0 in the order of the logs."""
        rollout = self.rollout
        found = []
        for number, w in enumerate(rollout.windows):
            log = rollout.logs[w.log]
            times_s = log.times_s[w.first : w.end]
            found.append(
                Record(
                    trial=number,
                    group=number,
                    held_out_with=w.part,
                    times_s=times_s - times_s[0],
                    measured=log.measured[w.first : w.end] / self.units.si,
                    factors={
                        **{n: log.slow(w.first, w.end)[f"by_{n}"] for n in log.factors},
                        "log": w.log + 1,
                        "time in the log": times_s[0] - log.times_s[0],
                    },
                )
            )
        return tuple(found)

    def predict(
        self, records: Sequence[Record], active: Sequence[str], vectors: np.ndarray
    ) -> np.ndarray:
        """Predict the windows' signals from their fitted start states (see `Model`)."""
        return self._predict(records, [self.effects[name] for name in active], vectors)

    def _predict(
        self, records: Sequence[Record], effects: Sequence[RobotEffect], vectors: np.ndarray
    ) -> np.ndarray:
        numbers, (start, _) = [r.trial for r in records], self._starts
        of, away = (numbers, [r.times_s for r in records]), self._away(numbers, start[numbers])
        found = self.rollout.simulate(*of, effects, vectors, away) / self.units.si
        seen = [row for row, r in enumerate(records) if np.isfinite(r.measured).any()]
        twisted = list(self._twisted(records, effects, vectors, away, found)) if seen else []
        if self.step.shift is not None:
            for row, record in enumerate(records):
                at = self._samples(record)
                found[:, row, : len(at)] += self.step.shift[record.trial, at]
        raw = {one: found[one].copy() for one, _ in twisted}
        for row in seen:
            record, k = records[row], len(records[row].times_s)
            missed = record.measured - found[:, row, :k]
            found[:, row, :k] += self.start_shift(record, missed, start[record.trial])
        for (one, twists), row in product(twisted, seen):
            record, k = records[row], len(records[row].times_s)
            path, slopes = raw[one][row, :k], twists[row, :k].reshape(-1, twists.shape[-1])
            missed, own = record.measured - path, start[record.trial]
            found[one, row, :k] = path + self._twist_shift(record, missed, own, slopes)
        return found

    def _twisted(
        self,
        records: Sequence[Record],
        effects: Sequence[RobotEffect],
        vectors: np.ndarray,
        away: np.ndarray,
        found: np.ndarray,
    ) -> Iterator[tuple[int, np.ndarray]]:
        """Yield vectors with few elastic joints, and slopes (n_windows, k, d, m) by their twists.

        How far a link is behind its encoder at the start follows from the acceleration there and
        its rate, which samples tell badly: by their deviations, or by what they are along the path.
        """
        at, springs = len(self.parameters), []
        for effect in effects:
            if isinstance(effect, ElasticJoint):
                springs.append((at, effect.where.dofs))
            at += len(effect.parameters)
        numbers, times_s = [r.trial for r in records], [r.times_s for r in records]
        for one, vector in enumerate(vectors):
            dofs = sorted({dof for at, own in springs for dof in own if vector[at]})
            if not 0 < len(dofs) <= FEW_ELASTIC:
                continue
            places, other = [*product(range(2), dofs)], []
            bends = np.array(
                [self._bends(r, own) for r, own in zip(records, found[one], strict=True)]
            )
            for order, dof in places:
                other.append(away.copy())
                known = [self.rollout.windows[k].bends_sd[order, dof] for k in numbers]
                other[-1][:, 2 + order, dof] = np.minimum(known, bends[:, order, dof])
            of = numbers * len(places), times_s * len(places)
            path = self.rollout.simulate(*of, effects, vector[None], np.concatenate(other))[0]
            path = (path / self.units.si).reshape(len(places), *found.shape[1:])
            yield one, np.nan_to_num(np.moveaxis(path - found[one], 0, -1))

    def _bends(self, record: Record, path: np.ndarray) -> np.ndarray:
        """Return how much joints accelerate along a window's path (k, d), and its rate, (2, nv).

        Root mean squares; infinite where no encoder shows a joint.
        """
        found, rates = [], path[: len(record.times_s)] * self.units.si
        for _ in range(3):
            rates = np.gradient(rates, record.times_s, axis=0)
            found.append(np.sqrt((rates**2).mean(axis=0)))
        bends = np.full((2, self.rollout.robot.model.nv), np.inf)
        for k, at in enumerate(self.rollout.robot.measured):
            if at.kind == "position":
                bends[:, at.dof] = found[1][k], found[2][k]
        return bends

    def idle(self, records: Sequence[Record]) -> np.ndarray:
        """Predict windows (n, k, d) as if nothing acted: joints go on as they moved."""
        longest, signals = max(len(r.times_s) for r in records), list(self.rollout.robot.measured)
        found = np.full((len(records), longest, len(signals)), np.nan)
        for path, record in zip(found, records, strict=True):
            window, k = self.rollout.windows[record.trial], len(record.times_s)
            by = np.outer(record.times_s, window.qvel)
            qpos = moved(self.rollout.robot.model, np.tile(window.qpos, (k, 1)), by)
            for column, at in enumerate(signals):
                if at.kind in ("position", "turn"):
                    path[:k, column] = qpos[:, at.index] / self.units.si[column]
                elif at.kind == "velocity":
                    path[:k, column] = window.qvel[at.dof] / self.units.si[column]
                else:
                    path[:k, column] = record.measured[0, column]
        return found

    @cached_property
    def nominal_misses(self) -> list[np.ndarray]:
        """What the known model misses of every window (see `misses`)."""
        return self.misses(self.known_paths())

    def known_paths(self) -> np.ndarray:
        """Predict all windows by the known model, (n_windows, k, d)."""
        return self._predict(self.records, self.known.effects, self.known.values[None])[0]

    def misses(self, paths: np.ndarray) -> list[np.ndarray]:
        """Return predicted − measured of all windows, (k, d) each, NaN where a run diverged."""
        pairs = zip(paths, self.records, strict=True)
        return [path[: len(r.times_s)] - r.measured for path, r in pairs]

    @cached_property
    def perfect_misses(self) -> list[np.ndarray]:
        """What noise and start states leave of a perfect model in every window, (draws, k, d) each.

        Noise is drawn and put on both; the start is fitted as it is to measured windows. It is the
        least that repeats would differ by: what else varies from run to run is not in it.
        """
        rng = np.random.default_rng(0)
        missed = []
        for record in self.records:
            slopes, _ = self._gain(record)
            shape = (DRAWS, *record.measured.shape)
            left = rng.normal(size=shape) * self.units.noise
            left += (rng.normal(size=(DRAWS, slopes.shape[1])) @ slopes.T).reshape(shape)
            missed.append(left - self.start_shift(record, left))
        return missed

    @property
    def is_led(self) -> bool:
        """Whether slopes are taken where the known model says that the robot started."""
        return bool(self._starts[0].any())

    def starts_are_put_right(self) -> bool:
        """Tell whether slopes put starts right that are off by their noise, to below the noise.

        Where the motion bends too much within a window they do not, and a perfect model would miss
        more than `perfect_misses`. Where the slopes are taken at estimated starts, nobody knows.
        """
        start, _ = self._starts
        if self.is_led:
            return True
        rng, every = np.random.default_rng(0), range(len(start))
        paths = [self._paths(every, rng.normal(size=start.shape)) for _ in range(TRIED)]
        moved, missed = np.array(paths) - self._paths(every, start), []
        for own, record in enumerate(self.records):
            left = moved[:, own, : len(record.times_s)]
            missed.append(left - self.start_shift(record, left))
        return self.usual_miss(missed) < self.usual_miss(self.perfect_misses)

    @property
    def finer(self) -> "RobotModel | None":
        """The same model with a shorter step: diagnosis asks it by what that shifts sizes.

        None where the logs follow the model's own.
        """
        if self.step.shift is None and self.step.left < 1:
            return None
        _ = self._starts  # which both have in common
        other = copy(self)
        other.__dict__.pop("nominal_misses", None)
        other.rollout, other.step = self.rollout.finer(FINER), Step()
        return other

    def usual_miss(self, missed: Iterable[np.ndarray]) -> float:
        """Return what is missed in the window in the middle, of (…, k, d) each, % of the scale."""
        means = [np.nanmean(np.linalg.norm(one, axis=-1)) for one in missed]
        return 100 * float(np.nanmedian(means)) / self.scale

    def usual_misses(self, missed: Iterable[np.ndarray]) -> np.ndarray:
        """Return the root mean square of every signal there, (d,), in its units."""
        squares = [np.nanmean(one**2, axis=tuple(range(one.ndim - 1))) for one in missed]
        return np.sqrt(np.nanmedian(squares, axis=0))

    def start_shift(
        self, record: Record, missed: np.ndarray, start: np.ndarray | float = 0.0
    ) -> np.ndarray:
        """Return by how much a better start moves signals that miss by (n, k, d) from `start`."""
        slopes, gain = self._gain(record)
        flat = np.nan_to_num(missed).reshape(len(missed), -1) + (slopes * start).sum(axis=1)
        # not by BLAS, whose sums depend on how many rows there are
        better = np.clip(np.einsum("nk,sk->ns", flat, gain), -MOST_SD, MOST_SD)
        return np.einsum("ns,ks->nk", better - start, slopes).reshape(missed.shape)

    def _twist_shift(
        self, record: Record, missed: np.ndarray, start: np.ndarray, slopes: np.ndarray
    ) -> np.ndarray:
        """Return the same of one vector, with a better twist (m,) of `slopes` (k d, m), too.

        Of what it is fitted to, given the state, noise is what no start explains.
        """
        state, _ = self._gain(record)
        flat = np.nan_to_num(missed).ravel() + state @ start
        scatter = self._scatter(record, np.hstack([state, slopes]), flat)
        both = np.hstack([state, slopes / np.sqrt(scatter)])
        better = self._estimate(record, both)[: len(start)] @ flat
        better = np.clip(better, -MOST_SD, MOST_SD)
        twist = self._estimate(record, slopes, scatter) @ (flat - state @ better)
        shift = state @ (better - start) + slopes @ np.clip(twist, -MOST_SD, MOST_SD)
        return shift.reshape(missed.shape)

    def _gain(self, record: Record) -> tuple[np.ndarray, np.ndarray]:
        """Return slopes (k d, 2 nv) by the start's deviations, and what estimates those."""
        key = (record.trial, record.times_s.tobytes())
        if key not in self._gains:
            slopes = self._starts[1][record.trial]
            slopes = slopes[self._samples(record)].reshape(-1, slopes.shape[2])
            self._gains[key] = slopes, self._estimate(record, slopes)
        return self._gains[key]

    def _samples(self, record: Record) -> np.ndarray:
        """Return which of its window's samples a record has, (k,)."""
        return np.searchsorted(self.records[record.trial].times_s, record.times_s - 1e-12)

    def _estimate(self, record: Record, slopes: np.ndarray, scatter: float = 1.0) -> np.ndarray:
        """Return what a start's deviations are estimated with from misses, (2 nv, k d).

        A start is as likely as its samples say, a priori, and every sample is off by its noise, of
        a variance that is `scatter` times as large.
        """
        seen = np.isfinite(record.measured).ravel()
        precision = np.tile(self.units.noise**-2 / scatter, len(record.times_s)) * seen
        hold = slopes.T @ (slopes * precision[:, None]) + np.eye(slopes.shape[1])
        return np.linalg.solve(hold, slopes.T * precision)

    def _scatter(self, record: Record, slopes: np.ndarray, missed: np.ndarray) -> float:
        """Return by how much the noise must be larger, in squares, for what no start explains.

        That is left of what is `missed` (k d,); at least 1.
        """
        left = missed - slopes @ (self._estimate(record, slopes) @ missed)
        left = (left.reshape(record.measured.shape) / self.units.noise)[
            np.isfinite(record.measured)
        ]
        return max(1.0, float(np.mean(left**2)))

    @cached_property
    def _starts(self) -> tuple[np.ndarray, np.ndarray]:
        """Where slopes are taken, and the known model's slopes there.

        Both by deviations of every start coordinate, (n_windows, 2 nv), (n_windows, k, d, 2 nv).
        Of hinges and slides alone it is the measured state, which is known well. How a body turns
        freely is not, and bends its path: there it is where the known model, if it leads, says that
        the robot started, as far as that can be believed: what it misses anyway counts as noise.
        """
        model = self.rollout.robot.model
        start = np.zeros((len(self.records), 2 * model.nv))
        paths, slopes = self._sloped(start)
        if not (self.known.leads and turning(model).any()):
            return start, slopes
        for own, record, path, by in zip(start, self.records, paths, slopes, strict=True):
            k = len(record.times_s)
            flat, missed = by[:k].reshape(-1, by.shape[2]), record.measured - path[:k]
            missed = np.nan_to_num(missed).ravel()
            gain = self._estimate(record, flat, self._scatter(record, flat, missed))
            own[:] = np.clip(gain @ missed, -MOST_SD, MOST_SD)
        return start, self._sloped(start)[1]

    def _sloped(self, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return signals (n_windows, k, d) from starts, and slopes by their deviations."""
        n_windows, n_states = start.shape
        n = 1 + n_states
        around = np.repeat(start[:, None], n, axis=1)
        around[:, 1:] += np.eye(n_states)
        numbers = np.repeat(np.arange(n_windows), n).tolist()
        found = self._paths(numbers, around.reshape(-1, n_states))
        found = found.reshape(n_windows, n, *found.shape[1:])
        return found[:, 0], np.nan_to_num(np.moveaxis(found[:, 1:] - found[:, :1], 1, -1))

    def _paths(self, numbers: Sequence[int], start: np.ndarray) -> np.ndarray:
        """Return the known model's signals (n, k, d) from starts that deviate (n, 2 nv)."""
        times_s, known = [self.records[k].times_s for k in numbers], self.known
        away, values = self._away(numbers, start), known.values[None]
        return (
            self.rollout.simulate(numbers, times_s, known.effects, values, away)[0] / self.units.si
        )

    def _away(self, numbers: Sequence[int], start: np.ndarray) -> np.ndarray:
        """Return deviations (n, 2 nv) of windows' starts in SI units, (n, 4, nv).

        Of accelerations and their rates there are none.
        """
        sd = np.array([self.rollout.windows[k].start_sd for k in numbers])
        state = start.reshape(sd.shape) * sd
        return np.concatenate([state, np.zeros_like(state)], axis=1)


def tuned_parameters(robot: RobotFile) -> tuple[Parameter, ...]:
    """Return the parameters of the nominal fit, about what the model says."""
    found = []
    for one in robot.tune:
        nominal = one.start
        if nominal is None:
            nominal = 1.0 if one.factor else float(np.mean(one.at.nominal(robot.model)))
        if not one.lower <= nominal <= one.upper:
            raise ValueError(
                f"{robot.path}: tune {one.at.name}: the model's {nominal:g} lies outside of the "
                f"bounds {one.lower:g} to {one.upper:g}"
            )
        found.append(Parameter(one.at.name, "1", one.lower, one.upper, nominal, frozen=one.frozen))
    return tuple(found)
