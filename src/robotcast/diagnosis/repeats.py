"""What repeats of one action tell: how large noise is, before any model is asked."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robotcast.diagnosis.misfit import padded
from robotcast.diagnosis.model import Record
from robotcast.diagnosis.time_grid import TimeGrid


@dataclass(frozen=True)
class RepeatScatter:
    """The errors that a perfect model would still show.

    Attributes
    ----------
    sample_percent, final_percent : average deviation and median final deviation in % of scale;
        None without repeats.
    over_time_percent : average deviation at every time of the grid, (n_times,), NaN where no two
        repeats share it.
    groups, trials : how many groups hold repeats, and the trials they make together.
    """

    sample_percent: float | None
    final_percent: float | None
    over_time_percent: np.ndarray
    groups: int
    trials: int


def repeated(records: Sequence[Record], rows: Sequence[int]) -> list[list[int]]:
    """Sort `rows` of the records by group and return those groups that have at least two."""
    groups: dict[int, list[int]] = {}
    for row in rows:
        groups.setdefault(records[row].group, []).append(row)
    return [group for group in groups.values() if len(group) > 1]


def repeat_scatter(records: Sequence[Record], grid: TimeGrid, scale: float) -> RepeatScatter:
    """Estimate the noise floor from the trials that share a group."""
    measured = grid.place(padded(records, [r.measured for r in records]))
    averages, finals, deviations, trials = [], [], [], []
    for rows in repeated(records, range(len(records))):
        deviation = _deviations(measured[rows])
        deviation = deviation[np.isfinite(deviation).any(axis=1)]
        if len(deviation):
            averages.append(np.nanmean(deviation, axis=1))
            finals.append(_deviations(np.stack([records[row].measured[-1:] for row in rows])))
            deviations.append(deviation)
            trials.append(len(rows))
    if not trials:
        return RepeatScatter(None, None, np.full(len(grid.times_s), np.nan), 0, 0)
    return RepeatScatter(
        sample_percent=float(100 / scale * np.concatenate(averages).mean()),
        final_percent=float(100 / scale * np.median(np.concatenate(finals))),
        over_time_percent=100 / scale * mean_of_present(np.concatenate(deviations)),
        groups=len(trials),
        trials=sum(trials),
    )


def _deviations(repeats: np.ndarray) -> np.ndarray:
    """Return distances from the mean over axis 0, as if the true mean were known.

    The mean of n repeats lies too near to each of them, on average √((n − 1)/n) as far as the
    true mean does, so each distance is multiplied by √(n/(n − 1)). A sample that no other
    repeat shares tells nothing and is NaN.

    Parameters
    ----------
    repeats : ndarray of shape (n, n_times, d), NaN where a repeat has no sample.

    Returns
    -------
    ndarray of shape (n, n_times).
    """
    n = np.isfinite(repeats[..., 0]).sum(axis=0)
    distance = np.linalg.norm(repeats - mean_of_present(repeats), axis=-1)
    return np.where(n > 1, distance * np.sqrt(n / np.maximum(n - 1, 1)), np.nan)


def mean_of_present(values: np.ndarray) -> np.ndarray:
    """Return the mean over axis 0 of what is not NaN; NaN where nothing is."""
    present = np.isfinite(values)
    count = present.sum(axis=0)
    total = np.where(present, values, 0.0).sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
