"""Common times for the samples of many trials."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robotcast.diagnosis.model import Record


@dataclass(frozen=True)
class TimeGrid:
    """Times one sampling period apart; every sample belongs to the nearest.

    Attributes
    ----------
    times_s : ndarray of shape (n_times,).
    steps : for every trial, the index into `times_s` of each of its samples (k,).
    """

    times_s: np.ndarray
    steps: tuple[np.ndarray, ...]

    @classmethod
    def of(cls, records: Sequence[Record]) -> "TimeGrid":
        """Lay the grid through the first trial's first sample."""
        gaps = np.concatenate([np.diff(r.times_s) for r in records])
        period_s = float(np.median(gaps)) if len(gaps) else 1.0
        origin = records[0].times_s[0]
        steps = [np.round((r.times_s - origin) / period_s).astype(int) for r in records]
        first, last = min(s.min() for s in steps), max(s.max() for s in steps)
        times_s = origin + period_s * np.arange(first, last + 1)
        return cls(times_s, tuple(s - first for s in steps))

    def place(self, values: np.ndarray) -> np.ndarray:
        """Bring values of samples (n_trials, k_max, ...) to (n_trials, n_times, ...).

        NaN where a trial has no sample.
        """
        placed = np.full((len(values), len(self.times_s), *values.shape[2:]), np.nan)
        for row, step, some in zip(placed, self.steps, values, strict=True):
            row[step] = some[: len(step)]
        return placed

    def at_samples(self, values: np.ndarray, k_max: int) -> np.ndarray:
        """Return what `values` (n_times,) say at every sample, (n_trials, k_max), NaN past them."""
        found = np.full((len(self.steps), k_max), np.nan)
        for row, step in zip(found, self.steps, strict=True):
            row[: len(step)] = values[step]
        return found
