"""Robust nonlinear least squares over trials, with every evaluation batched.

Levenberg–Marquardt on finite-difference Jacobians (Nocedal and Wright 2006, ch. 10). A trial
counts by the root of its mean square (a pseudo-Huber loss over whole trials), because a few
whip-like trials miss by ten times the rest and would otherwise decide the fit.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from robotcast.fitting.parameter import Parameter

DAMPINGS = (1e-4, 1e-2, 1e-1, 1.0, 10.0)  # tried side by side, in units of the curvature
DIFFERENCE = 0.02  # of a parameter's range; of an effect's strength, from its probes
PRIOR_SD = 1.0  # of a parameter's range: holds what the trials do not tell at its start
ENOUGH = 2e-3  # a step that lowers the loss by less than this share ends the fit

Residuals = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""(unit vectors (n_vectors, n), numbers of trials (m,)) → (n_vectors, m, D) residuals.

Residuals are in units of the noise and divided by the root of the number of samples, so that
the sum of squares of a trial is its mean square; 0 past its samples. All are finite.
"""


@dataclass(frozen=True)
class Fit:
    """Where a fit ended.

    Attributes
    ----------
    vector : ndarray of shape (n,), in [0, 1].
    loss : mean over trials of √(1 + mean square) − 1.
    residual : ndarray of shape (n_trials, D).
    jacobian : ndarray of shape (n_trials, D, n), of the residuals, near `vector`.
    """

    vector: np.ndarray
    loss: float
    residual: np.ndarray
    jacobian: np.ndarray

    @property
    def weights(self) -> np.ndarray:
        """How much each trial counts, (n_trials,)."""
        return trial_weights(self.residual)


def trial_losses(residual: np.ndarray) -> np.ndarray:
    """Return √(1 + mean square) − 1 of every trial, (..., n_trials); ∞ where it diverged."""
    return np.sqrt(1 + (residual**2).sum(axis=-1)) - 1


def trial_weights(residual: np.ndarray) -> np.ndarray:
    """Return the weights of the equivalent weighted least squares, (n_trials,)."""
    return 1 / np.sqrt(1 + (residual**2).sum(axis=-1))


def difference_steps(parameters: Sequence[Parameter]) -> np.ndarray:
    """Return the finite-difference step of every parameter, in units of its range."""
    return np.array([_difference(p) for p in parameters])


def _difference(parameter: Parameter) -> float:
    if parameter.null is None or not parameter.probes:
        return DIFFERENCE
    null, probes = np.asarray(parameter.null), np.asarray(parameter.probes)
    reach = np.abs(parameter.to_unit(probes) - parameter.to_unit(null))
    return float(0.25 * reach.max())


def jacobian(
    residuals: Residuals, vector: np.ndarray, steps: np.ndarray, trials: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the residuals (n_trials, D) at `vector` and their Jacobian (n_trials, D, n).

    Each difference goes towards the middle of the range, so that none leaves it.
    """
    signed = np.where(vector > 0.5, -steps, steps)
    rows = np.vstack([vector, vector + np.diag(signed)])
    values = residuals(rows, trials)
    slopes = (values[1:] - values[0]) / signed[:, None, None]
    return values[0], np.moveaxis(slopes, 0, -1)


def fit_robustly(
    residuals: Residuals,
    start: np.ndarray,
    steps: np.ndarray,
    trials: np.ndarray,
    *,
    iterations: int,
    known: Fit | None = None,
    free: np.ndarray | None = None,
) -> Fit:
    """Minimise the loss from `start` (n,), inside [0, 1].

    Parameters
    ----------
    trials : numbers of the trials that the fit sees, (m,).
    known : a fit of these trials that ended at `start`; its Jacobian serves the first step.
    free : bool (n,), which parameters may change; all by default.
    """
    free = np.ones(len(start), bool) if free is None else free
    if known is None:
        known = _evaluate(residuals, start, steps, trials)
    best, fresh = known, True
    for iteration in range(iterations):
        if not fresh:
            best = _evaluate(residuals, best.vector, steps, trials)
        tried = _proposals(best, start, free)
        values = residuals(tried, trials)
        losses = _whole_loss(values, tried, start)
        chosen = int(np.argmin(losses))
        before = _whole_loss(best.residual[None], best.vector[None], start)[0]
        if not losses[chosen] < before:
            break
        best = replace(
            best,
            vector=tried[chosen],
            residual=values[chosen],
            loss=float(trial_losses(values[chosen]).mean()),
        )
        fresh = False
        if losses[chosen] > before * (1 - ENOUGH) and iteration:
            break
    return best


def _evaluate(
    residuals: Residuals, vector: np.ndarray, steps: np.ndarray, trials: np.ndarray
) -> Fit:
    residual, slopes = jacobian(residuals, vector, steps, trials)
    return Fit(vector, float(trial_losses(residual).mean()), residual, slopes)


def _whole_loss(residual: np.ndarray, vectors: np.ndarray, start: np.ndarray) -> np.ndarray:
    prior = ((vectors - start) ** 2).sum(axis=-1) / PRIOR_SD**2
    return trial_losses(residual).sum(axis=-1) + 0.5 * prior


def _proposals(fit: Fit, start: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Return one step for every damping, (n_dampings, n), clipped to the range."""
    weighted = fit.jacobian * fit.weights[:, None, None]
    curvature = np.einsum("idn,idm->nm", weighted, fit.jacobian)
    curvature += np.eye(len(start)) / PRIOR_SD**2
    slope = np.einsum("idn,id->n", weighted, fit.residual) + (fit.vector - start) / PRIOR_SD**2
    curvature, slope = curvature[np.ix_(free, free)], slope[free]
    proposals = np.tile(fit.vector, (len(DAMPINGS), 1))
    for row, damping in zip(proposals, DAMPINGS, strict=True):
        step = np.linalg.solve(curvature + damping * np.diag(np.diag(curvature)), slope)
        row[free] -= step
    return np.clip(proposals, 0.0, 1.0)
