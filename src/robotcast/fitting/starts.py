"""Where searches start: vectors all over the ranges, which trials they look at, and an ensemble.

By ensemble Kalman inversion (Iglesias, Law and Stuart 2013) a crowd of parameter vectors moves to
where the trials are predicted well. Its slopes are taken across the whole crowd, by regression of
what it misses on its parameters, so that the many narrow valleys of a chaotic model average out
and only the broad one that leads to the answer is left.
"""

import numpy as np
from scipy.stats import qmc

from robotcast.fitting.least_squares import Residuals, median_miss


def hypercube(centre: np.ndarray, width: float, n: int, seed: int) -> np.ndarray:
    """Return a Latin hypercube (n, n_parameters) about a unit vector, clear of the bounds."""
    cube = qmc.LatinHypercube(len(centre), rng=np.random.default_rng(seed)).random(n)
    return np.clip(centre + width * (cube - 0.5), 0.02, 0.98)


def spread(trials: np.ndarray, n: int) -> np.ndarray:
    """Return about n of the trials, evenly spaced."""
    return trials[:: max(1, len(trials) // n)]


CAUTION = 0.02  # variance allowed to every sample of what is missed, the sum over a trial being 1
EDGE = 0.02  # of a range, from which members keep clear


def ensemble_start(
    residuals: Residuals, members: np.ndarray, trials: np.ndarray, updates: int, seed: int
) -> np.ndarray:
    """Return the unit vector (n,) at which an ensemble centres, to start a fit from.

    The `members` (n_members, n) are unit vectors all over where the answer may lie. Each update
    takes n_members simulations of every one of the numbered trials (m,).
    """
    rng = np.random.default_rng(seed)
    for _ in range(updates):
        members = _moved(members, residuals(members, trials), rng)
    return members.mean(axis=0)


def _moved(members: np.ndarray, missed: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return members moved towards missing nothing, one Kalman update with perturbed data."""
    missed = _bounded(missed)
    spread = members - members.mean(axis=0)
    apart, sizes, along = np.linalg.svd(missed - missed.mean(axis=0), full_matrices=False)
    data = np.sqrt(CAUTION) * rng.normal(size=missed.shape)
    wanted = (data - missed) @ along.T
    gain = sizes / (sizes**2 + (len(members) - 1) * CAUTION)
    return np.clip(members + (wanted * gain) @ (apart.T @ spread), EDGE, 1 - EDGE)


def _bounded(missed: np.ndarray) -> np.ndarray:
    """Return residuals (n_members, m, D) as (n_members, m D); no trial counts for more than 1.

    The median one counts half: far away all pull, nearer by those that tip over no longer do.
    """
    unit = median_miss(missed)
    size = np.sqrt(max(1.0, unit) ** 2 + (missed**2).sum(axis=-1))
    return (missed / size[..., None]).reshape(len(missed), -1)
