"""Whether the same effects would have come first on other trials of the same kind."""

import numpy as np

from robotcast.diagnosis.errors import misses
from robotcast.diagnosis.selection import Found

RESAMPLES = 2000


def first_in_resamples(found: Found, groups: np.ndarray, seed: int) -> dict[str, float]:
    """Return the share of resamples in which the set of each judged effect predicts best.

    Whole groups of trials are drawn with replacement (the bootstrap, Efron 1979). Compared are
    the held-out errors of judged sets of one size, so nothing is simulated; where the model as it
    is predicts better, none comes first.

    Parameters
    ----------
    groups : ndarray of shape (n_trials,), the group of every trial, numbered from 0.
    """
    if not found.judged or found.scales is None:
        return {}
    fixed = len(found.base.effects)
    size = max(len(found.chosen) - fixed, 1)
    sets = [effects for effects in found.judged if len(effects) == fixed + size]
    if not sets:
        return {}
    n = int(groups.max()) + 1
    drawn = np.random.default_rng(seed).multinomial(n, np.full(n, 1 / n), size=RESAMPLES)
    missed = np.array(
        [
            drawn
            @ _mean_of_groups(misses(found.judged[e].errors.waypoint, found.scales.unit), groups)
            for e in (found.base.effects, *sets)
        ]
    )
    first = np.bincount(missed.argmin(axis=0), minlength=len(sets) + 1)[1:] / RESAMPLES
    order = np.argsort(first)
    return {name: float(first[k]) for k in order for name in sets[k][fixed:]}


def _mean_of_groups(values: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """Return the mean of trials' values (n_trials,) in every group, (n_groups,)."""
    return np.bincount(groups, values) / np.bincount(groups)
