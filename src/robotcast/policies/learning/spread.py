"""How far casts end from where a forward model says, set on casts held out from its training."""

import numpy as np

_WITHIN = 0.6827  # part of a normal distribution within one standard deviation


def held_out_scale(misses_m: np.ndarray, relative: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the spread [m] that a relative spread of 1 means, for x and y, (2,).

    It is chosen so that 68 % of the held-out casts, by weight, miss by less than their spread.
    The quantile is the next larger one that n casts have (Vovk et al. 2005), so that few casts
    make a model say too much spread rather than too little; whip-like casts that miss by far
    count no more than others.

    Parameters
    ----------
    misses_m : ndarray of shape (n, 2), measured minus predicted endpoints.
    relative : ndarray of shape (n,), what the model says of its spread, up to a factor.
    weights : ndarray of shape (n,).
    """
    ratios = np.abs(misses_m) / relative[:, None]
    order = np.argsort(ratios, axis=0, kind="stable")
    part = np.cumsum(weights[order], axis=0) / weights.sum()
    wanted = min(1.0, _WITHIN * (1 + 1 / len(ratios))) - 1e-12
    return np.array(
        [ratios[order[np.searchsorted(part[:, c], wanted), c], c] for c in range(ratios.shape[1])]
    )
