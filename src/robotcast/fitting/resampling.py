"""Measured paths at other times than those at which they were sampled."""

import numpy as np
from scipy.interpolate import CubicSpline

SAME = 1e-6  # of a period: so near, a sample is taken as it stands
GAP = 1.6  # periods between two samples, above which nothing was seen between them


def at_times(
    wanted_s: np.ndarray, times_s: np.ndarray, values: np.ndarray, period_s: float
) -> np.ndarray:
    """Return `values` (k, d), sampled at `times_s` (k,), at times `wanted_s` (n,), as (n, d).

    A cubic spline goes through the samples: frames that come late are no error. NaN outside of
    the samples and in gaps between them.
    """
    found = np.full((len(wanted_s), values.shape[1]), np.nan)
    after = np.clip(np.searchsorted(times_s, wanted_s), 0, len(times_s) - 1)
    before = np.maximum(after - 1, 0)
    for sample in (before, after):
        same = np.abs(times_s[sample] - wanted_s) <= SAME * period_s
        found[same] = values[sample[same]]
    between = np.isnan(found).any(axis=1) & (wanted_s > times_s[before])
    between &= (wanted_s < times_s[after]) & (times_s[after] - times_s[before] < GAP * period_s)
    if between.any():
        found[between] = CubicSpline(times_s, values)(wanted_s[between])
    return found
