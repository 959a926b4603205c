"""A revision of the model: the effects that act and the fit of its parameters."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.side_by_side import side_by_side
from robotcast.fitting.ensemble import ensemble_start
from robotcast.fitting.least_squares import Fit
from robotcast.fitting.starts import hypercube, spread

FOLDS = 4
EARLY = 0.65  # share of every trial that the search for a start sees: chaos comes late
FEW, SOME = 13, 26  # trials that an ensemble sees, and the fit that follows it
ENSEMBLES, MEMBERS, UPDATES = 2, 40, 4
ALL_OVER = 0.8  # of every range: where an ensemble's members lie about the nominal vector
EARLY_ITERATIONS = 5


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
    waypoint, final : ndarrays of shape (n_trials,).
    vectors : ndarray of shape (n_folds, n), the unit vectors of the folds' fits.
    """

    waypoint: np.ndarray
    final: np.ndarray
    vectors: np.ndarray


def fit_base(
    inquiry: Inquiry,
    effects: Sequence[str],
    seed: int,
    iterations: int,
    about: np.ndarray | None = None,
) -> Revision:
    """Fit from where ensembles find a start, to beginnings of some trials first, then to all.

    What a chaotic model does late in a trial has a valley for every way in which it tips over;
    the beginnings lead smoothly to the right one.

    Parameters
    ----------
    about : a unit vector (n,), one of the ensemble's members; the others take their effects from
        it. The nominal one by default.
    """
    effects = tuple(effects)
    about = inquiry.nominal(effects) if about is None else about
    early = inquiry.beginnings(EARLY, SOME)
    begun = [_begun(early, effects, about, seed + k) for k in range(ENSEMBLES)]
    best = min(begun, key=lambda fit: fit.loss)
    return Revision(effects, inquiry.fit(effects, best.vector, iterations))


def _begun(early: Inquiry, effects: tuple[str, ...], about: np.ndarray, seed: int) -> Fit:
    """Return a fit to beginnings from where an ensemble of the model's own parameters centres."""
    nominal, free = early.nominal(effects), early.free(effects)
    free[len(early.model.parameters) :] = False
    members = np.where(free, hypercube(nominal, ALL_OVER, MEMBERS, seed), about)
    members[0] = about
    few = spread(early.everything, FEW)
    start = ensemble_start(early.residuals(effects), members, few, UPDATES, seed)
    return early.fit(effects, np.where(free, start, about), EARLY_ITERATIONS)


def refit(inquiry: Inquiry, revision: Revision, iterations: int) -> Revision:
    """Go on with the fit of a revision."""
    effects = revision.effects
    fit = revision.fit
    return Revision(effects, inquiry.fit(effects, fit.vector, iterations, known=fit))


def folds(groups: np.ndarray, seed: int) -> list[np.ndarray]:
    """Split trials into folds so that none cuts a group; return each fold's trial numbers."""
    order = np.random.default_rng(seed).permutation(groups.max() + 1)
    n = min(FOLDS, len(order))
    return [np.flatnonzero(np.isin(groups, order[k::n])) for k in range(n)]


def held_out(inquiry: Inquiry, revision: Revision, seed: int, iterations: int) -> HeldOut:
    """Refit without each fold, from the fit on all trials, and predict the fold."""
    whole = revision.fit

    def rest_fit(fold: np.ndarray) -> Fit:
        rest = np.setdiff1d(inquiry.everything, fold)
        known = Fit(whole.vector, whole.loss, whole.residual[rest], whole.jacobian[rest])
        start, effects = whole.vector, revision.effects
        return inquiry.fit(effects, start, iterations, trials=rest, known=known)

    cut = folds(inquiry.groups, seed)
    fits = list(side_by_side(rest_fit, cut))
    waypoint, final = np.empty((2, len(inquiry.records)))
    for fold, fit in zip(cut, fits, strict=True):
        waypoint[fold], final[fold] = inquiry.errors(revision.effects, fit.vector, fold)
    return HeldOut(waypoint, final, np.array([fit.vector for fit in fits]))
