"""Where searches start: vectors all over the ranges, and which trials they look at."""

import numpy as np
from scipy.stats import qmc


def hypercube(centre: np.ndarray, width: float, n: int, seed: int) -> np.ndarray:
    """Return a Latin hypercube (n, n_parameters) about a unit vector, clear of the bounds."""
    cube = qmc.LatinHypercube(len(centre), rng=np.random.default_rng(seed)).random(n)
    return np.clip(centre + width * (cube - 0.5), 0.02, 0.98)


def spread(trials: np.ndarray, n: int) -> np.ndarray:
    """Return about n of the trials, evenly spaced."""
    return trials[:: max(1, len(trials) // n)]
