"""How far one prediction is from the measured trials, sample by sample."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robotcast.diagnosis.model import Record


@dataclass(frozen=True)
class Misfit:
    """Predicted minus measured, padded to the longest trial."""

    # (n_trials, k_max, d); NaN past a trial's samples and in all of a trial whose run diverged
    error: np.ndarray
    # (n_trials, k_max), the length of `error`; one `scale` for every sample of a diverged trial,
    # NaN past a trial's samples
    distance: np.ndarray
    present: np.ndarray  # bool (n_trials, k_max), the samples that trials have
    diverged: np.ndarray  # bool (n_trials,)
    ended: np.ndarray  # bool (n_trials,)
    scale: float  # errors in % refer to it

    @property
    def sample_percent(self) -> np.ndarray:
        """Average error of every trial in % of scale, (n_trials,)."""
        return 100 / self.scale * np.nanmean(self.distance, axis=1)

    @property
    def final_percent(self) -> np.ndarray:
        """Error where every trial ended in % of scale, (n_trials,); NaN where that is unknown."""
        last = self.present.sum(axis=1) - 1
        percent = 100 / self.scale * self.distance[np.arange(len(last)), last]
        return np.where(self.ended, percent, np.nan)


def misfit(records: Sequence[Record], predicted: np.ndarray, scale: float) -> Misfit:
    """Compare a prediction (n_trials, k_max, d) with the records.

    A prediction that lacks one sample of a trial counts as diverged in the whole trial.
    """
    k_most = max((len(r.times_s) for r in records), default=0)
    if not k_most:
        raise ValueError("comparing needs at least one trial with a sample")
    wanted = (len(records), k_most, records[0].measured.shape[1])
    if predicted.shape[::2] != wanted[::2] or predicted.shape[1] < k_most:
        raise ValueError(f"expected a prediction of shape {wanted}, got {predicted.shape}")
    present = sample_mask(records)
    error = predicted[:, :k_most] - padded(records, [r.measured for r in records])
    lacking = np.isnan(error).any(axis=-1) & present
    diverged = np.asarray(lacking.any(axis=1))
    error[diverged] = np.nan
    distance = np.linalg.norm(error, axis=-1)
    distance[diverged] = scale
    distance[~present] = np.nan
    ended = np.array([r.ended for r in records])
    return Misfit(error, distance, present, diverged, ended, scale)


def known_median(values: np.ndarray) -> float:
    """Return the median of those that are no NaN; NaN where all are."""
    known = values[~np.isnan(values)]
    return float(np.median(known)) if len(known) else np.nan


def sample_mask(records: Sequence[Record]) -> np.ndarray:
    """Return which samples the trials have, bool (n_trials, k_max)."""
    counts = np.array([len(r.times_s) for r in records])
    return np.arange(counts.max()) < counts[:, None]


def padded(records: Sequence[Record], values: Sequence[np.ndarray]) -> np.ndarray:
    """Stack one array (k, ...) a trial into (n_trials, k_max, ...), NaN past its samples."""
    k_most = max(len(r.times_s) for r in records)
    stacked = np.full((len(records), k_most, *values[0].shape[1:]), np.nan)
    for row, some in zip(stacked, values, strict=True):
        row[: len(some)] = some
    return stacked
