"""A revision of the model: the effects that act and the fit of its parameters."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from robotcast.diagnosis.misfit import padded
from robotcast.diagnosis.model import Model, Record
from robotcast.diagnosis.rule import Effort
from robotcast.fitting.least_squares import (
    LOST,
    Fit,
    Prior,
    Residuals,
    Stepping,
    bread,
    difference_steps,
    fit_robustly,
    optimism,
    trial_losses,
)
from robotcast.fitting.parameter import Parameter
from robotcast.fitting.starts import ensemble_start, hypercube, spread
from robotcast.running import Progress, silent

EXPECTED = 4.0  # times its largest probe: how strong an effect may be before any trial is seen

# a second step for each Jacobian costs little beside it
STEPPING = Stepping(most=2, may_jitter=True)


class Inquiry:
    """Everything that the steps of a diagnosis ask of the model.

    Residuals are weighed against `noise`, by how much repeats differ, in the model's unit;
    `progress` is told how many trials were simulated so far.
    """

    def __init__(
        self,
        model: Model,
        records: Sequence[Record],
        noise: float,
        progress: Progress = silent,
    ) -> None:
        self.model = model
        self.records = tuple(records)
        self.noise = noise
        self.runs = _Runs(progress)
        self._step_errors: dict[tuple[tuple[str, ...], bytes], np.ndarray] = {}

    @property
    def simulated(self) -> int:
        """How many trials were simulated so far."""
        return self.runs.done

    def beginnings(self, share: float, n: int) -> "Inquiry":
        """Return the same inquiry into the beginnings of n of the trials, evenly spaced.

        Of every trial it sees this share of the samples, the first ones.
        """
        some = [_beginning(self.records[i], share) for i in spread(self.everything, n)]
        other = Inquiry(self.model, some, self.noise)
        other.runs = self.runs
        return other

    @cached_property
    def everything(self) -> np.ndarray:
        """Numbers of all trials, (n_trials,)."""
        return np.arange(len(self.records))

    @cached_property
    def groups(self) -> np.ndarray:
        """Which trials are held out together, numbered from 0, (n_trials,)."""
        return np.unique([r.together for r in self.records], return_inverse=True)[1]

    def parameters(self, active: Sequence[str]) -> tuple[Parameter, ...]:
        """Return the parameters of the model with these effects, in a vector's order."""
        own = [p for name in active for p in self.model.effects[name].parameters]
        return (*self.model.parameters, *own)

    def entries(self, active: Sequence[str], name: str) -> slice:
        """Return where in a vector the parameters of one of the effects stand."""
        first = len(self.parameters(active[: active.index(name)]))
        return slice(first, first + len(self.model.effects[name].parameters))

    def special_cases(self, name: str, others: Sequence[str]) -> list[str]:
        """Return which others have some of an effect's parameters, fewer strengths, and its part.

        That part is of a robot, where effects act on parts of one. What acts on each joint in a
        size of its own has one size for all as a special case, and a single joint.
        """

        def known(n: str) -> tuple[set[Any], int, Any]:
            effect = self.model.effects[n]
            strengths = sum(p.null is not None for p in effect.parameters)
            names = {(p.name, p.unit, p.null) for p in effect.parameters}
            return names, strengths, getattr(effect, "where", None)

        own, most, part = known(name)
        among = [(n, *known(n)) for n in others]
        cases = [n for n, some, fewer, at in among if some < own and fewer < most and at == part]
        return cases + [other for _, other in self.nested([name], others)]

    def nested(self, names: Sequence[str], others: Sequence[str]) -> list[tuple[str, str]]:
        """Return which effects, of a size of its own in each joint, hold which others."""
        every: Any = self.model.effects
        whole = [n for n in names if getattr(getattr(every[n], "where", None), "each", False)]
        return [(n, one) for n in whole for one in others if every[one].is_part_of(every[n])]

    def carried(
        self,
        active: Sequence[str],
        of: Sequence[str],
        vector: np.ndarray,
        onto: np.ndarray | None = None,
    ) -> np.ndarray:
        """Return a vector, nominal by default, with what it shares with one of other effects."""
        found, own = self.nominal(active) if onto is None else onto.copy(), self.parameters(())
        found[: len(own)] = vector[: len(own)]
        for name in set(active) & set(of):
            found[self.entries(active, name)] = vector[self.entries(of, name)]
        return found

    def have_guess(self, names: Sequence[str]) -> list[str]:
        """Return the effects whose parameters the model guesses."""
        return [n for n in names if getattr(self.model.effects[n], "guess", None) is not None]

    def guessed(
        self, active: Sequence[str], vector: np.ndarray, of: Sequence[str]
    ) -> np.ndarray | None:
        """Return a vector with the parameters of some effects as they are guessed, if any are.

        Of effects of which one holds another, the larger one alone.
        """
        held = {part for _, part in self.nested(of, of)}
        found, names = vector.copy(), [n for n in self.have_guess(of) if n not in held]
        for name in names:
            effect: Any = self.model.effects[name]
            pairs = zip(effect.parameters, effect.guess, strict=True)
            units = [p.to_unit(np.asarray(x)) for p, x in pairs]
            found[self.entries(active, name)] = np.clip(units, 0.0, 1.0)
        return found if names else None

    def steps(self, active: Sequence[str]) -> np.ndarray:
        """Return the finite-difference steps of all parameters."""
        return difference_steps(self.parameters(active))

    def free(self, active: Sequence[str]) -> np.ndarray:
        """Return which parameters a fit may change, bool (n,)."""
        return np.array([not p.frozen for p in self.parameters(active)], bool)

    def expected(self, active: Sequence[str]) -> np.ndarray:
        """Return the standard deviations (n,) that are expected before any trial, of the ranges."""
        return np.array([_expected(p) for p in self.parameters(active)])

    def nominal(self, active: Sequence[str]) -> np.ndarray:
        """Return the unit vector where every parameter has its nominal value."""
        return np.array([float(p.to_unit(np.asarray(p.nominal))) for p in self.parameters(active)])

    def values(self, active: Sequence[str], vectors: np.ndarray) -> np.ndarray:
        """Return unit vectors (n_vectors, n) as parameter values."""
        vectors = np.atleast_2d(vectors)
        found = np.empty_like(vectors)
        for k, parameter in enumerate(self.parameters(active)):
            found[:, k] = parameter.from_unit(vectors[:, k])
        return found

    def residuals(self, active: Sequence[str]) -> Residuals:
        """Return the residuals of the model with these effects as a fit wants them."""

        def evaluate(vectors: np.ndarray, trials: np.ndarray) -> np.ndarray:
            difference = self.differences(active, vectors, trials)
            present = np.isfinite(self.measured[trials])
            counts = present.all(axis=-1).sum(axis=1)
            lost = (np.isnan(difference) & present).any(axis=(2, 3))
            weighed = np.nan_to_num(difference) / (np.sqrt(counts)[:, None, None] * self.noise)
            lost |= (weighed**2).sum(axis=(2, 3)) >= LOST**2
            weighed[lost] = 0
            weighed[lost, 0, 0] = LOST
            return weighed.reshape(len(vectors), len(trials), -1)

        return evaluate

    def step_shift(self, active: Sequence[str], fit: Fit, inverse: np.ndarray) -> np.ndarray:
        """Return by how much the model's own step moves a fit, (n,); 0 where it is not known.

        `inverse` is that of the fit's curvature, (n, n).
        """
        finer, key = getattr(self.model, "finer", None), (tuple(active), fit.vector.tobytes())
        if finer is None:
            return np.zeros(len(fit.vector))
        if key not in self._step_errors:
            other = Inquiry(finer, self.records, self.noise)
            exact = other.residuals(active)(fit.vector[None], self.everything)[0]
            self._step_errors[key] = fit.residual - exact
        off = self._step_errors[key]
        return inverse @ np.einsum("idn,id,i->n", fit.jacobian, off, fit.weights)

    def fit(
        self,
        active: Sequence[str],
        start: np.ndarray,
        iterations: int,
        *,
        trials: np.ndarray | None = None,
        known: Fit | None = None,
        like: Fit | None = None,
        stepping: Stepping = STEPPING,
    ) -> Fit:
        """Fit the model with these effects (see `fit_robustly`), to all trials by default."""
        return fit_robustly(
            self.residuals(active),
            start,
            self.steps(active),
            self.everything if trials is None else trials,
            iterations=iterations,
            known=known,
            like=like,
            free=self.free(active),
            prior=Prior(self.nominal(active), self.expected(active)),
            stepping=stepping,
        )

    def fit_whole(self, active: Sequence[str], begun: Sequence[Fit], iterations: int) -> Fit:
        """Fit all trials from fits to their beginnings: an iteration from each, then from the best.

        Beginnings do not tell which of their valleys the whole trials share: of two fits that
        miss them alike one may lead to half of what the other misses.
        """
        fits = [self.fit(active, fit.vector, 1, like=fit) for fit in begun]
        best = min(fits, key=lambda fit: fit.loss)
        return self.fit(active, best.vector, iterations - 1, like=best)

    def expected_loss(self, active: Sequence[str], fit: Fit) -> float:
        """Return the mean loss that a fit to all trials will have on others of the same kind."""
        too_small = self.optimism(active, fit, self.everything)
        return float(trial_losses(fit.residual).sum() + too_small) / len(self.records)

    def optimism(self, active: Sequence[str], fit: Fit, trials: np.ndarray) -> float:
        """Return by how much the loss of a fit to some trials is too small (see `optimism`)."""
        return optimism(fit, bread(fit, self.expected(active)), self.groups[trials])

    def differences(
        self, active: Sequence[str], vectors: np.ndarray, trials: np.ndarray
    ) -> np.ndarray:
        """Return predicted − measured, (n_vectors, m, k_max, d); NaN as in `Model.predict`."""
        chosen = [self.records[i] for i in trials]
        predicted = self.model.predict(chosen, active, self.values(active, vectors))
        self.runs.add(len(vectors) * len(trials))
        return self.against(predicted, trials)

    def against(self, predicted: np.ndarray, trials: np.ndarray) -> np.ndarray:
        """Return what was predicted (n, m, k, d) less what was measured, (n, m, k_max, d)."""
        measured = self.measured[trials]
        k = max(len(self.records[i].times_s) for i in trials)
        wanted = (len(predicted), len(trials), k, measured.shape[2])
        if predicted.shape != wanted:
            raise ValueError(f"expected a prediction of shape {wanted}, got {predicted.shape}")
        difference = np.full((len(predicted), *measured.shape), np.nan)
        difference[:, :, :k] = predicted - measured[:, :k]
        return difference

    def percent(self, difference: np.ndarray, trials: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Turn differences (m, k_max, d) into average and final errors, in % of the scale.

        A trial whose run diverged counts with one scale; the final error of one that was not seen
        to end is NaN.
        """
        distance = np.linalg.norm(difference, axis=-1)
        counts = np.array([len(self.records[i].times_s) for i in trials])
        average = np.array([row[:k].mean() for row, k in zip(distance, counts, strict=True)])
        final = np.array([row[k - 1] for row, k in zip(distance, counts, strict=True)])
        lost, ended = np.isnan(average), np.array([self.records[i].ended for i in trials])
        return (
            100 * np.where(lost, 1.0, average / self.model.scale),
            100 * np.where(ended, np.where(lost, 1.0, final / self.model.scale), np.nan),
        )

    def low_percent(self, difference: np.ndarray) -> np.ndarray:
        """Return the error that a quarter of each trial's samples stays below, (m,), in %."""
        distance = np.linalg.norm(difference, axis=-1)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # of trials whose run diverged
            low = np.nanquantile(distance, 0.25, axis=1)
        return 100 * np.nan_to_num(low / self.model.scale, nan=1.0)

    def difference_of(self, residual: np.ndarray, trials: np.ndarray) -> np.ndarray:
        """Turn residuals (m, D) back into differences (m, k, d)."""
        counts = np.array([len(self.records[i].times_s) for i in trials])
        shape = (len(trials), -1, self.records[0].measured.shape[1])
        found = residual.reshape(shape) * (np.sqrt(counts) * self.noise)[:, None, None]
        found[np.isnan(self.measured[trials])] = np.nan
        return found

    @cached_property
    def measured(self) -> np.ndarray:
        """The measured signals (n_trials, k_max, d), NaN past a trial's own."""
        return padded(self.records, [r.measured for r in self.records])


class _Runs:
    """Counts simulated trials and tells."""

    def __init__(self, progress: Progress) -> None:
        self.done = 0
        self._progress = progress

    def add(self, runs: int) -> None:
        self.done += runs
        self._progress(self.done, 0)


def _beginning(record: Record, share: float) -> Record:
    k = max(2, round(share * len(record.times_s)))
    return replace(record, times_s=record.times_s[:k], measured=record.measured[:k])


def _expected(parameter: Parameter) -> float:
    if parameter.null is None or not parameter.probes:
        return parameter.prior_sd
    null, probes = np.asarray(parameter.null), np.asarray(parameter.probes)
    reach = np.abs(parameter.to_unit(probes) - parameter.to_unit(null)).max()
    return float(min(EXPECTED * reach, parameter.prior_sd)) or parameter.prior_sd


FEW = 0.5  # of the trials whose beginnings a fit sees: those that an ensemble sees
MEMBERS, UPDATES = 40, 4
ALL_OVER = 0.8  # of every range: where an ensemble's members lie about the nominal vector
EARLY_ITERATIONS = 4


@dataclass(frozen=True)
class Revision:
    """A fitted model."""

    effects: tuple[str, ...]  # names of the active effects
    fit: Fit  # on all trials


@dataclass(frozen=True)
class HeldOut:
    """Errors of every trial under parameters fitted without its group, % of the scale."""

    waypoint: np.ndarray  # average error, (n_trials,)
    final: np.ndarray  # the error at the last sample, (n_trials,)
    low: np.ndarray  # what a quarter of a trial's samples stay below, (n_trials,)
    vectors: np.ndarray  # (n_folds, n), the unit vectors of the folds' fits


def fit_base(
    inquiry: Inquiry, effects: Sequence[str], effort: Effort, about: np.ndarray | None = None
) -> Revision:
    """Fit from where an ensemble finds a start, to beginnings of some trials first, then to all.

    What a chaotic model does late in a trial has a valley for every way in which it tips over;
    the beginnings lead smoothly to a good one. A start from the nominal parameters stands beside
    the ensemble's; `about` is a unit vector (n,) in the place of the nominal one.
    """
    effects = tuple(effects)
    early = inquiry.beginnings(effort.early, effort.some)
    nominal = early.nominal(effects) if about is None else about
    free, starts = early.free(effects), [nominal]
    free[len(early.model.parameters) :] = False
    if free.any():
        members = np.where(free, hypercube(nominal, ALL_OVER, MEMBERS, effort.seed), nominal)
        members[0] = nominal
        few = spread(early.everything, max(1, round(FEW * effort.some)))
        centre = ensemble_start(early.residuals(effects), members, few, UPDATES, effort.seed)
        starts.append(np.where(free, centre, nominal))
    begun = [early.fit(effects, start, EARLY_ITERATIONS) for start in starts]
    return Revision(effects, inquiry.fit_whole(effects, begun, effort.base))


def folds(groups: np.ndarray, n_folds: int, seed: int) -> list[np.ndarray]:
    """Split trials into folds so that none cuts a group; return each fold's trial numbers."""
    order = np.random.default_rng(seed).permutation(groups.max() + 1)
    n = min(n_folds, len(order))
    return [np.flatnonzero(np.isin(groups, order[k::n])) for k in range(n)]


def held_out(inquiry: Inquiry, revision: Revision, effort: Effort) -> HeldOut:
    """Refit without each fold, from the fit on all trials, and predict the fold."""
    whole, effects = revision.fit, revision.effects
    n = len(inquiry.records)
    waypoint, final, low = np.empty((3, n))
    vectors, near = [], replace(STEPPING, most=1)
    for fold in folds(inquiry.groups, effort.folds, effort.seed):
        rest = np.setdiff1d(inquiry.everything, fold)
        known = replace(whole, residual=whole.residual[rest], jacobian=whole.jacobian[rest])
        fit = inquiry.fit(
            effects, whole.vector, effort.fold, trials=rest, known=known, stepping=near
        )
        vectors.append(fit.vector)
        missed = inquiry.differences(effects, fit.vector[None], fold)[0]
        waypoint[fold], final[fold] = inquiry.percent(missed, fold)
        low[fold] = inquiry.low_percent(missed)
    return HeldOut(waypoint, final, low, np.array(vectors))
