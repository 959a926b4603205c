"""How well trials tell the parameters of a fit."""

import numpy as np

from robotcast.fitting.least_squares import Fit


def curvature(fit: Fit) -> np.ndarray:
    """Return the curvature of the loss (n, n), in units of the noise over the ranges."""
    weighted = fit.jacobian * fit.weights[:, None, None]
    return np.einsum("idn,idm->nm", weighted, fit.jacobian)


def bread(fit: Fit, sd: np.ndarray) -> np.ndarray:
    """Return the inverse curvature (n, n), `sd` (n,) being what is expected before any trial."""
    return np.linalg.inv(curvature(fit) + np.diag(1 / sd**2))


def sandwich(fit: Fit, inverse: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """Return standard errors (n,) with groups of trials as clusters (Liang and Zeger 1986).

    Parameters
    ----------
    inverse : ndarray of shape (n, n), see `bread`.
    groups : int ndarray of shape (n_trials,), numbered from 0.
    """
    weighted = fit.jacobian * fit.weights[:, None, None]
    scores = np.einsum("idn,id->in", weighted, fit.residual)
    by_group = np.zeros((groups.max() + 1, scores.shape[1]))
    np.add.at(by_group, groups, scores)
    n, p = by_group.shape
    meat = by_group.T @ by_group * n / max(n - p, 1)
    return np.sqrt(np.diag(inverse @ meat @ inverse))
