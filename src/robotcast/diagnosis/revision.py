"""A revision of the model: the effects that act and the fit of its parameters."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robotcast.diagnosis.inquiry import STEPPING, Inquiry
from robotcast.diagnosis.rule import Effort
from robotcast.fitting.ensemble import ensemble_start
from robotcast.fitting.least_squares import Fit
from robotcast.fitting.starts import hypercube, spread

FEW = 0.5  # of the trials whose beginnings a fit sees: those that an ensemble sees
MEMBERS, UPDATES = 40, 4
ALL_OVER = 0.8  # of every range: where an ensemble's members lie about the nominal vector
EARLY_ITERATIONS = 3


@dataclass(frozen=True)
class Revision:
    """A fitted model.

    Attributes
    ----------
    effects : names of the active effects.
    fit : on all trials.
    """

    effects: tuple[str, ...]
    fit: Fit


@dataclass(frozen=True)
class HeldOut:
    """Errors of every trial under parameters fitted without its group, % of the scale.

    Attributes
    ----------
    waypoint, final : average error and the error at the last sample, ndarrays of shape (n_trials,).
    low : what a quarter of a trial's samples stay below, (n_trials,).
    vectors : ndarray of shape (n_folds, n), the unit vectors of the folds' fits.
    """

    waypoint: np.ndarray
    final: np.ndarray
    low: np.ndarray
    vectors: np.ndarray


def fit_base(
    inquiry: Inquiry, effects: Sequence[str], effort: Effort, about: np.ndarray | None = None
) -> Revision:
    """Fit from where an ensemble finds a start, to beginnings of some trials first, then to all.

    What a chaotic model does late in a trial has a valley for every way in which it tips over;
    the beginnings lead smoothly to the right one. A start from the nominal parameters stands
    beside the ensemble's.

    Parameters
    ----------
    about : a unit vector (n,) in the place of the nominal one.
    """
    effects = tuple(effects)
    early = inquiry.beginnings(effort.early, effort.some)
    nominal = early.nominal(effects) if about is None else about
    free = early.free(effects)
    free[len(early.model.parameters) :] = False
    members = np.where(free, hypercube(nominal, ALL_OVER, MEMBERS, effort.seed), nominal)
    members[0] = nominal
    few = spread(early.everything, max(1, round(FEW * effort.some)))
    centre = ensemble_start(early.residuals(effects), members, few, UPDATES, effort.seed)
    starts = (np.where(free, centre, nominal), nominal)
    begun = [early.fit(effects, start, 1) for start in starts]
    best = min(begun, key=lambda fit: fit.loss)
    best = early.fit(effects, best.vector, EARLY_ITERATIONS, known=best)
    return Revision(effects, inquiry.fit(effects, best.vector, effort.base, like=best))


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
        known = Fit(whole.vector, whole.loss, whole.residual[rest], whole.jacobian[rest])
        fit = inquiry.fit(
            effects, whole.vector, effort.fold, trials=rest, known=known, stepping=near
        )
        vectors.append(fit.vector)
        missed = inquiry.differences(effects, fit.vector[None], fold)[0]
        waypoint[fold], final[fold] = inquiry.percent(missed, fold)
        low[fold] = inquiry.low_percent(missed)
    return HeldOut(waypoint, final, low, np.array(vectors))
