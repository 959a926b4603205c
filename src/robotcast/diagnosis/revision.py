"""A revision of the model: the effects that act and the fit of its parameters."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.side_by_side import side_by_side
from robotcast.fitting.elimination import (
    Rounds,
    best_first,
    fit_by_elimination,
    hypercube,
    spread,
)
from robotcast.fitting.least_squares import Fit

FOLDS = 4
EARLY = 0.65  # share of every trial that the search for a start sees: chaos comes late
LOOKED_AT = 256  # parameter vectors of a first look, on a few trials
FEW, SOME = 13, 26  # trials of the first look and of the fits that follow it


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
    """Fit from many starts, by elimination (see `fit_by_elimination`).

    Parameters
    ----------
    about : a unit vector (n,), one of the starts; the others take their effects from it. The
        nominal one by default.
    """
    effects = tuple(effects)
    about = inquiry.nominal(effects) if about is None else about
    early = inquiry.beginnings(EARLY, SOME)
    starts = _starts(early, effects, about, seed)
    fits = partial(early.fit, effects), partial(inquiry.fit, effects)
    return Revision(effects, fit_by_elimination(*fits, starts, iterations, Rounds()))


def _starts(early: Inquiry, effects: tuple[str, ...], about: np.ndarray, seed: int) -> np.ndarray:
    """Return a Latin hypercube (n_starts, n) of the model's own parameters, best first."""
    nominal, free = early.nominal(effects), early.free(effects)
    free[len(early.model.parameters) :] = False
    looked = np.where(free, hypercube(nominal, 0.8, LOOKED_AT, seed), about)
    looked[0] = about
    return best_first(early.residuals(effects), spread(early.everything, FEW), looked)


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
