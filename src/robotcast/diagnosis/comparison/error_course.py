"""The error over time and against every factor."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robotcast.diagnosis.comparison.misfit import Misfit
from robotcast.diagnosis.comparison.repeats import RepeatScatter
from robotcast.diagnosis.model import Record
from robotcast.diagnosis.time_grid import TimeGrid

LEAST_PART = 0.5  # of the trials that must still be seen at a time
FEWEST_FOR_A_TREND = 8
WINDOW_PART = 0.3  # of the trials that a running median looks at


@dataclass(frozen=True)
class Course:
    """The error at every time, over the trials that were seen there.

    Attributes
    ----------
    times_s : ndarray of shape (n_times,); later ones, seen in less than half of the
        trials, are left out: they would show which trials are long, not how the error grows.
    mean, lower, median, upper : errors in % of scale and their quartiles, each (n_times,).
    noise : the repeats' average deviation in %, (n_times,), NaN where unknown.
    trials : how many were seen, (n_times,).
    """

    times_s: np.ndarray
    mean: np.ndarray
    lower: np.ndarray
    median: np.ndarray
    upper: np.ndarray
    noise: np.ndarray
    trials: np.ndarray


@dataclass(frozen=True)
class Trend:
    """Every trial's error against one factor.

    Attributes
    ----------
    values, errors : factor and average error in % of scale, each (n_trials,).
    running_values, running_median : the middle of the errors of neighbouring trials along the
        factor; empty for fewer than eight trials.
    """

    values: np.ndarray
    errors: np.ndarray
    running_values: np.ndarray
    running_median: np.ndarray


def error_over_time(found: Misfit, grid: TimeGrid, noise: RepeatScatter) -> Course:
    """Gather the error of all trials at the times of the grid."""
    percent = 100 / found.scale * grid.place(found.distance)
    count = np.isfinite(percent).sum(axis=0)
    seen = count >= max(1, LEAST_PART * len(percent))
    percent = percent[:, seen]
    lower, median, upper = np.nanquantile(percent, (0.25, 0.5, 0.75), axis=0)
    return Course(
        times_s=grid.times_s[seen],
        mean=np.nanmean(percent, axis=0),
        lower=lower,
        median=median,
        upper=upper,
        noise=noise.over_time_percent[seen],
        trials=count[seen],
    )


def median_phases(records: Sequence[Record]) -> dict[str, float]:
    """Return the median start [s] of every phase, over the trials that have it."""
    starts: dict[str, list[float]] = {}
    for record in records:
        for name, start in record.phases.items():
            starts.setdefault(name, []).append(start)
    return {name: float(np.median(some)) for name, some in starts.items()}


def trends(records: Sequence[Record], found: Misfit) -> dict[str, Trend]:
    """Return the error against every factor that all trials have and that varies."""
    shared = set.intersection(*(set(r.factors) for r in records))
    made = {}
    for name in (n for n in records[0].factors if n in shared):
        values = np.array([r.factors[name] for r in records], dtype=float)
        if np.ptp(values) > 0:
            made[name] = Trend(
                values, found.sample_percent, *_running(values, found.sample_percent)
            )
    return made


def _running(values: np.ndarray, errors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return medians over a window of trials that moves along `values`, (n,) each."""
    n = len(values)
    if n < FEWEST_FOR_A_TREND:
        return np.empty(0), np.empty(0)
    window = max(5, round(WINDOW_PART * n))
    order = np.argsort(values, kind="stable")
    windows = np.lib.stride_tricks.sliding_window_view
    return (
        np.median(windows(values[order], window), axis=-1),
        np.median(windows(errors[order], window), axis=-1),
    )
