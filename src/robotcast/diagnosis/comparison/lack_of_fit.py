"""Whether a model misses its actions by more than their repeats scatter."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robotcast.diagnosis.comparison.misfit import Misfit
from robotcast.diagnosis.comparison.repeats import repeated
from robotcast.diagnosis.model import Record
from robotcast.diagnosis.time_grid import TimeGrid

PATTERNS = 4096  # of signs: if there are no more, all are tried, else this many are drawn
PRIOR_DEGREES = 2.0  # what the average variance counts beside a time's own degrees of freedom


@dataclass(frozen=True)
class LackOfFit:
    """The mean errors of repeated actions against the scatter of their repeats.

    Attributes
    ----------
    ratio : variance of the groups' mean errors over the pure-error variance inside groups,
        about 1 for a model without fault.
    p_value : how often a ratio as large comes about when every trial's error is as likely as
        its opposite. Whole trials change sign, so nothing is assumed of how the errors inside
        a trial hang together, nor that all actions scatter alike.
    smallest_p_value : the least that this number of repeats allows.
    groups : number of repeated actions.
    """

    ratio: float
    p_value: float
    smallest_p_value: float
    groups: int


@dataclass(frozen=True)
class PureError:
    """Scatter of the errors inside groups of repeats.

    Attributes
    ----------
    variance : ndarray of shape (n_times,), expected squared length of one trial's scatter at
        every time of the grid, pulled a little towards the average over time.
    lack_of_fit : the test that stands on it.
    """

    variance: np.ndarray
    lack_of_fit: LackOfFit


def pure_error(
    records: Sequence[Record],
    found: Misfit,
    usual: np.ndarray,
    grid: TimeGrid,
    rng: np.random.Generator,
) -> PureError | None:
    """Estimate the pure-error variance of a prediction and test for lack of fit.

    The errors are compared, not the measurements: repeats are never driven quite alike, and
    what the model knows of that is no noise. None when no two repeats share a time.

    Parameters
    ----------
    usual : bool ndarray of shape (n_trials,), the trials that are no exceptions; diverged ones
        are left out besides.
    """
    groups = repeated(records, np.flatnonzero(usual & ~found.diverged).tolist())
    errors = [grid.place(found.error)[rows] for rows in groups]
    errors = [e for e in errors if (np.isfinite(e[..., 0]).sum(axis=0) > 1).any()]
    if not errors:
        return None
    signs, every = _sign_patterns([len(e) for e in errors], rng)
    ratios, variances = _ratios(errors, signs)
    as_large = int((ratios >= ratios[0] * (1 - 1e-9)).sum())
    fit = LackOfFit(
        ratio=float(ratios[0]),
        p_value=as_large / len(ratios),
        smallest_p_value=1 / every,
        groups=len(errors),
    )
    return PureError(variances[0], fit)


def _sign_patterns(sizes: Sequence[int], rng: np.random.Generator) -> tuple[np.ndarray, int]:
    """Return sign patterns (n_patterns, n_trials), the data's own first, and how many can differ.

    The first trial of each group keeps its sign: turning a whole group changes nothing.
    """
    free = np.concatenate([np.arange(size) > 0 for size in sizes])
    possible = 2 ** int(free.sum())
    signs = np.ones((min(possible, PATTERNS), len(free)))
    if possible <= PATTERNS:
        bits = np.arange(possible)[:, None] >> np.arange(free.sum()) & 1
        signs[:, free] = 1 - 2 * bits
        return signs, possible
    signs[1:, free] = rng.choice([-1.0, 1.0], size=(PATTERNS - 1, int(free.sum())))
    return signs, PATTERNS


def _ratios(errors: Sequence[np.ndarray], signs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the ratio (n_patterns,) and the variance (n_patterns, n_times) of every pattern."""
    n_times = errors[0].shape[1]
    between, within = np.zeros((2, len(signs), n_times))
    groups, degrees = np.zeros((2, n_times))
    at = 0
    for error in errors:
        count = np.isfinite(error[..., 0]).sum(axis=0)
        used = count > 1
        some = np.nan_to_num(error[:, used])
        total = np.einsum("jkd,jkd->k", some, some)
        mean_part = np.einsum("pj,jkd->pkd", signs[:, at : at + len(error)], some)
        of_mean = (mean_part**2).sum(axis=-1) / count[used]
        between[:, used] += of_mean
        within[:, used] += total - of_mean
        groups[used] += 1
        degrees[used] += count[used] - 1
        at += len(error)
    # repeats that agree to the last digit leave no scatter to divide by
    least = max(1e-9 * (between + within).mean(), np.finfo(float).tiny)
    average = np.maximum(within.sum(axis=1) / degrees.sum(), least)[:, None]
    variance = (within + PRIOR_DEGREES * average) / (degrees + PRIOR_DEGREES)
    return (between / variance).sum(axis=1) / groups.sum(), variance
