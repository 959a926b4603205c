"""A revision of the model: the effects that act and the fit of its parameters."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import qmc

from robotcast.diagnosis.inquiry import Inquiry
from robotcast.fitting.least_squares import Fit, fit_robustly, trial_losses

STARTS = 4  # local fits of the base model, from the best of a first look
LOOKED_AT = 192  # parameter vectors of that first look
FOLDS = 4


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


def fit_base(inquiry: Inquiry, effects: Sequence[str], seed: int, iterations: int) -> Revision:
    """Fit from several starts: the best of a first look at a third of the trials."""
    effects = tuple(effects)
    residuals, trials = inquiry.residuals(effects), inquiry.everything
    nominal, free, steps = inquiry.nominal(effects), inquiry.free(effects), inquiry.steps(effects)
    cube = qmc.LatinHypercube(len(nominal), rng=np.random.default_rng(seed)).random(LOOKED_AT)
    looked = np.where(free, np.clip(nominal + 0.8 * (cube - 0.5), 0.02, 0.98), nominal)
    looked[0] = nominal
    losses = trial_losses(residuals(looked, trials[::4])).mean(axis=1)
    starts = looked[np.argsort(losses, kind="stable")[:STARTS]]
    fits = [
        fit_robustly(residuals, start, steps, trials, iterations=4, free=free) for start in starts
    ]
    best = min(fits, key=lambda fit: fit.loss)
    return refit(inquiry, Revision(effects, best), iterations)


def refit(inquiry: Inquiry, revision: Revision, iterations: int) -> Revision:
    """Go on with the fit of a revision."""
    fit = fit_robustly(
        inquiry.residuals(revision.effects),
        revision.fit.vector,
        inquiry.steps(revision.effects),
        inquiry.everything,
        iterations=iterations,
        free=inquiry.free(revision.effects),
    )
    return Revision(revision.effects, fit)


def folds(groups: np.ndarray, seed: int) -> list[np.ndarray]:
    """Split trials into folds so that none cuts a group; return each fold's trial numbers."""
    order = np.random.default_rng(seed).permutation(groups.max() + 1)
    n = min(FOLDS, len(order))
    return [np.flatnonzero(np.isin(groups, order[k::n])) for k in range(n)]


def held_out(inquiry: Inquiry, revision: Revision, seed: int, iterations: int) -> HeldOut:
    """Refit without each fold, from the fit on all trials, and predict the fold."""
    waypoint, final = np.empty((2, len(inquiry.records)))
    vectors = []
    for fold in folds(inquiry.groups, seed):
        rest = np.setdiff1d(inquiry.everything, fold)
        whole = revision.fit
        known = Fit(whole.vector, whole.loss, whole.residual[rest], whole.jacobian[rest])
        fit = fit_robustly(
            inquiry.residuals(revision.effects),
            whole.vector,
            inquiry.steps(revision.effects),
            rest,
            iterations=iterations,
            known=known,
            free=inquiry.free(revision.effects),
        )
        waypoint[fold], final[fold] = inquiry.errors(revision.effects, fit.vector, fold)
        vectors.append(fit.vector)
    return HeldOut(waypoint, final, np.array(vectors))
