"""How well trials tell the parameters of a fit."""

import numpy as np

from robotcast.fitting.least_squares import Fit, curvature


def bread(fit: Fit, sd: np.ndarray) -> np.ndarray:
    """Return the inverse curvature (n, n), `sd` (n,) being what is expected before any trial."""
    return np.linalg.inv(curvature(fit) + np.diag(1 / sd**2))


def sandwich(fit: Fit, inverse: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """Return standard errors (n,) with groups of trials as clusters (Liang and Zeger 1986).

    The `inverse` (n, n) is that of `bread`; `groups` (n_trials,) are numbered from 0.
    """
    by_group = _scores(fit, groups)
    n, p = by_group.shape
    meat = by_group.T @ by_group * n / max(n - p, 1)
    return np.sqrt(np.diag(inverse @ meat @ inverse))


def optimism(fit: Fit, inverse: np.ndarray, groups: np.ndarray) -> float:
    """Return by how much the loss, summed over trials, is too small for having been fitted.

    What further trials of the same kind will miss more than those fitted to, for a model that is
    a little wrong (Takeuchi 1976; Akaike's number of parameters where it is not).
    """
    by_group = _scores(fit, groups)
    return float(np.trace(inverse @ by_group.T @ by_group))


def _scores(fit: Fit, groups: np.ndarray) -> np.ndarray:
    """Return the slopes of every group's loss (n_groups, n)."""
    weighted = fit.jacobian * fit.weights[:, None, None]
    scores = np.einsum("idn,id->in", weighted, fit.residual)
    by_group = np.zeros((groups.max() + 1, scores.shape[1]))
    np.add.at(by_group, groups, scores)
    return by_group
