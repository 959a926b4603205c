"""What a perfect model would still miss of a robot's logs: noise, and what its step errs by.

A robot knows no step, though logs of a simulation may follow the model's own. An effect that is
smaller than what the step errs by would be lost in that. So where the known model comes near what
is measured, its windows tell which of the two they follow, and every prediction is moved by what a
step as short as can be moves the known model by (a deferred correction, Fox 1947, doi
10.1098/rspa.1947.0060).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import mujoco
import numpy as np

from robotcast.diagnosis.errors import misses, worse
from robotcast.diagnosis.rule import Rule
from robotcast.fitting.parameter import Parameter
from robotcast.robots.robot_model import FINER, RobotModel, Step

STEP = 0.002  # of a parameter's range, by which slopes are taken
SURE = 0.01  # one-sided p-value, over parts of logs, that tells which step they follow


@dataclass(frozen=True)
class RobotFloor:
    """What a perfect model would still miss, in % of the usual motion."""

    percent: float
    noise_percent: float  # the part of it that noise leaves, or that repeats differ by
    step_percent: float  # the part of it that predictions err by because of the model's step
    whole_step_percent: float  # the same where nothing puts that right
    signals: np.ndarray  # of every signal, (n_signals,), in its units
    repeated: bool  # repeats told it; else noise and start states alone, the least it can be

    @classmethod
    def of(cls, model: RobotModel) -> "RobotFloor":
        """Take what repeats differ by, or else what noise leaves, and what the step adds to it."""
        errors, repeated = step_errors(model), _repeats_apart(model)
        whole, _ = _taken_up(model, errors[0], errors[1:])
        both = repeated or model.perfect_misses, [model.step.left * one for one in whole]
        known, step = map(model.usual_miss, both)
        signals = np.hypot(*map(model.usual_misses, both))
        percent = float(np.hypot(known, step))
        return cls(percent, known, step, model.usual_miss(whole), signals, bool(repeated))


def read_step(model: RobotModel) -> None:
    """Let a model follow the step that the logs tell, by what each of the two leaves to it.

    What the other step moves it by, its known parameters may take up. Where it is not at the floor
    with either, another model's step may err by something else.
    """
    errors, found = step_errors(model), []
    whole, _ = _taken_up(model, errors[0], errors[1:])
    noise, err = model.usual_miss(model.perfect_misses), model.usual_miss(whole)
    for step in (Step(), Step(-errors[0], 1 / _times_less(model))):
        model.step = step
        left, taken = _taken_up(model, model.misses(model.known_paths()), errors[1:])
        seen = [one[np.isfinite(one).all(axis=1)] for one in left]
        means = [np.linalg.norm(one, axis=1).mean() if len(one) else np.inf for one in seen]
        found.append((100 / model.scale * np.array(means), step, taken))
    (own, model.step, _), (shorter, step, taken) = found
    if min(np.median(own), np.median(shorter)) > np.hypot(noise, err):
        return
    parts = np.unique([r.together for r in model.records], return_inverse=True)[1]
    less = np.nan_to_num(misses(own, noise) - misses(shorter, noise))  # 0 where both diverged
    if worse(less, parts, Rule.far) < SURE:
        every, known = _parameters(model), model.known
        rows, ends = _about(every, known.values), np.array([(p.lower, p.upper) for p in every])
        values = np.clip(rows[0] + taken @ (rows[1:] - rows[0]), *ends.reshape(-1, 2).T)
        model.step, model.known = step, replace(known, values=values)
    elif worse(-less, parts, Rule.far) < SURE:
        model.step = Step(None, 1 / FINER)


def step_errors(model: RobotModel) -> np.ndarray:
    """Return by how much the known model errs because its step is no shorter, first of all.

    It is seen by a finer one, of which a part is left. Then follows by how much each of its n free
    parameters moves it, (1 + n, n_windows, k, d) in all, in the model's units.
    """
    numbers, times_s = range(len(model.records)), [record.times_s for record in model.records]
    effects, vectors = model.known.effects, _about(_parameters(model), model.known.values)
    coarse = model.rollout.simulate(numbers, times_s, effects, vectors)
    exact = model.rollout.finer(FINER).simulate(numbers, times_s, effects, vectors[:1])
    less = _times_less(model)
    whole = (coarse[:1] - exact) * less / (less - 1)
    return np.nan_to_num(np.concatenate([whole, coarse[1:] - coarse[:1]]) / model.units.si)


def _times_less(model: RobotModel) -> int:
    """Return how many times less a finer step errs: Runge–Kutta's by the fourth power."""
    rk4 = model.rollout.robot.model.opt.integrator == int(mujoco.mjtIntegrator.mjINT_RK4)
    return FINER ** (4 if rk4 else 1)


def _taken_up(
    model: RobotModel, missed: Sequence[np.ndarray], slopes: np.ndarray
) -> tuple[list[np.ndarray], np.ndarray]:
    """Return what start states and parameters leave of misses, (k, d) a window, and their steps.

    Windows count by what is missed of them, as in a fit. NaN stays where nothing was measured.
    """
    parts = []
    for row, (record, own) in enumerate(zip(model.records, missed, strict=True)):
        k = len(record.times_s)
        part = np.concatenate([own[None, :k], slopes[:, row, :k]])
        parts.append(part - model.start_shift(record, part))
    size = np.array([np.nanmean(np.append(part[0] ** 2, 0.0)) for part in parts])
    weights = 1 / np.sqrt(np.median(size) + size + 1e-12)
    flat = [w * part.reshape(len(part), -1) for w, part in zip(weights, parts, strict=True)]
    rows = np.nan_to_num(np.concatenate(flat, axis=1))
    taken = np.linalg.lstsq(rows[1:].T, -rows[0], rcond=None)[0]
    return [part[0] + np.tensordot(taken, part[1:], 1) for part in parts], taken


def _parameters(model: RobotModel) -> list[Parameter]:
    return [*model.parameters, *(p for e in model.known.effects for p in e.parameters)]


def _repeats_apart(model: RobotModel) -> list[np.ndarray]:
    """Return how far repeats differ in windows that they share, (k, d) each; empty without any.

    Windows of repeated logs at the same time start from other states; what the same model misses
    of them differs only by what a run has that another has not.
    """
    logs, windows = (
        model.rollout.logs,
        zip(model.rollout.windows, model.nominal_misses, strict=True),
    )
    missed, apart = {(w.log, w.first): one for w, one in windows}, []
    for one, other in combinations(range(len(logs)), 2):
        if logs[one].motion != logs[other].motion:
            continue
        for log, first in [at for at in missed if at[0] == one and (other, at[1]) in missed]:
            k = min(len(missed[log, first]), len(missed[other, first]))
            apart.append((missed[log, first][:k] - missed[other, first][:k]) / np.sqrt(2))
    return apart


def _about(parameters: Sequence[Parameter], values: np.ndarray) -> np.ndarray:
    """Return values (1 + n_free, n), and others with one of the first, parameters, a step away."""
    rows = [values]
    for k, p in enumerate(parameters):
        unit = float(p.to_unit(np.asarray(values[k])))
        if not p.frozen:
            there = unit + (STEP if unit < 0.5 else -STEP)
            rows.append(values.copy())
            rows[-1][k] = p.from_unit(np.asarray(there))
    return np.array(rows)
