"""By how much repeats of one action scatter: what a model without fault still misses."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.stats import ttest_1samp

from robotcast.diagnosis.model import Record
from robotcast.diagnosis.rule import RULE, Rule
from robotcast.fitting.resampling import at_times

MOST_TIMES = 10  # of a grid, for each sample of the longest trial


@dataclass(frozen=True)
class TimeGrid:
    """Times one sampling period apart; every sample belongs to the nearest."""

    times_s: np.ndarray  # (n_times,)
    steps: tuple[np.ndarray, ...]  # for every trial, the index into `times_s` of each sample, (k,)
    period_s: float

    @classmethod
    def of(cls, records: Sequence[Record]) -> "TimeGrid":
        """Lay the grid through the first trial's first sample."""
        gaps = np.concatenate([np.diff(r.times_s) for r in records])
        period_s = float(np.median(gaps)) if len(gaps) else 1.0
        origin, span_s = records[0].times_s[0], max(r.times_s[-1] - r.times_s[0] for r in records)
        # samples in pairs have no period: no more times than the samples are worth
        period_s = max(period_s, span_s / (MOST_TIMES * max(len(r.times_s) for r in records)))
        steps = [np.round((r.times_s - origin) / period_s).astype(int) for r in records]
        first, last = min(s.min() for s in steps), max(s.max() for s in steps)
        times_s = origin + period_s * np.arange(first, last + 1)
        return cls(times_s, tuple(s - first for s in steps), period_s)

    def place(self, values: np.ndarray) -> np.ndarray:
        """Bring values of samples (n_trials, k_max, ...) to (n_trials, n_times, ...).

        NaN where a trial has no sample.
        """
        placed = np.full((len(values), len(self.times_s), *values.shape[2:]), np.nan)
        for row, step, some in zip(placed, self.steps, values, strict=True):
            row[step] = some[: len(step)]
        return placed

    def paths(self, records: Sequence[Record]) -> np.ndarray:
        """Return what was measured at the times of the grid, (n_trials, n_times, d), NaN in gaps.

        Between samples a spline goes through them, so that frames that came late do not scatter.
        """
        return np.stack(
            [at_times(self.times_s, r.times_s, r.measured, self.period_s) for r in records]
        )

    def at_samples(self, values: np.ndarray, k_max: int) -> np.ndarray:
        """Return what `values` (n_times,) say at every sample, (n_trials, k_max), NaN past them."""
        found = np.full((len(self.steps), k_max), np.nan)
        for row, step in zip(found, self.steps, strict=True):
            row[: len(step)] = values[step]
        return found


@dataclass(frozen=True)
class RepeatScatter:
    """The errors that a perfect model would still show."""

    sample_percent: float | None  # average deviation in % of scale; None without repeats
    final_percent: float | None  # median final deviation in % of scale; None without repeats
    # average deviation at every time of the grid, (n_times,), NaN where no two repeats share it
    over_time_percent: np.ndarray
    # the average square of deviations there, (n_times,); its mean in gaps, 0 without repeats
    square_over_time: np.ndarray
    # of every group, the average deviation of its trials, (n,) each
    deviations_percent: tuple[np.ndarray, ...]
    groups: int  # how many groups hold repeats
    trials: int  # the trials they make together
    # numbers of trials that lie too far from their repeats to be such; left out
    strays: tuple[int, ...] = ()
    # None where all repeats tell the scatter. Else those far apart in the session differ by this
    # much more than those that follow each other, of which alone the scatter is taken
    drift: float | None = None
    # whether any trial was repeated both soon and much later, so that drift would show
    far_apart: bool = False


def repeated(records: Sequence[Record], rows: Sequence[int]) -> list[list[int]]:
    """Sort `rows` of the records by group and return those groups that have at least two."""
    groups: dict[int, list[int]] = {}
    for row in rows:
        groups.setdefault(records[row].group, []).append(row)
    return [group for group in groups.values() if len(group) > 1]


def repeat_scatter(
    records: Sequence[Record], grid: TimeGrid, scale: float, rule: Rule = RULE
) -> RepeatScatter:
    """Estimate the noise floor from the trials that share a group, in the order of the session."""
    measured = grid.paths(records)
    strays = _strays(records, measured, rule)
    groups = repeated(records, [row for row in range(len(records)) if row not in strays])
    apart, drift = rule.close * len(records), None
    soon, late = _soon_and_late(groups, measured, apart)
    logs = np.log(late / soon)
    if len(soon) > 2 and np.array(ttest_1samp(logs, 0, alternative="greater"))[1] < rule.drift:
        drift = float(np.median(late / soon))
        cuts = [np.flatnonzero(np.diff(rows) > apart) + 1 for rows in groups]
        runs = [run for rows, cut in zip(groups, cuts, strict=True) for run in np.split(rows, cut)]
        groups = [run.tolist() for run in runs if len(run) > 1]
    averages, finals, away, trials = [], [], [], []
    for rows in groups:
        deviation = _deviations(measured[rows])
        deviation = deviation[np.isfinite(deviation).any(axis=1)]
        if len(deviation):
            averages.append(np.nanmean(deviation, axis=1))
            ended = [records[row].measured[-1:] for row in rows if records[row].ended]
            if len(ended) > 1:
                finals.append(_deviations(np.stack(ended)))
            away.append(deviation)
            trials.append(len(rows))
    numbers = tuple(records[row].trial for row in strays)
    if not trials:
        nowhere = np.full(len(grid.times_s), np.nan)
        return RepeatScatter(None, None, nowhere, np.zeros(len(nowhere)), (), 0, 0, numbers)
    every = np.concatenate(away)
    square = _of_present(np.ma.mean, every**2)
    return RepeatScatter(
        sample_percent=float(100 / scale * np.concatenate(averages).mean()),
        final_percent=float(100 / scale * np.median(np.concatenate(finals))) if finals else None,
        over_time_percent=100 / scale * _of_present(np.ma.mean, every),
        square_over_time=np.where(np.isnan(square), np.nanmean(square), square),
        deviations_percent=tuple(100 / scale * average for average in averages),
        groups=len(trials),
        trials=sum(trials),
        strays=numbers,
        drift=drift,
        far_apart=bool(len(soon)),
    )


def _soon_and_late(
    groups: Sequence[Sequence[int]], measured: np.ndarray, apart: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return how far repeats differ that follow each other, and that lie far apart, by group.

    Only groups that hold both count, so that what one action scatters by stands on either side.
    """
    soon, late = [], []
    for rows in groups:
        both = [[], []]
        for first, second in combinations(rows, 2):
            distance = np.linalg.norm(measured[first] - measured[second], axis=-1)
            both[second - first > apart].append(float(np.nanmean(distance)))
        if all(both) and min(map(min, both)) > 0:
            soon.append(np.mean(both[0]))
            late.append(np.mean(both[1]))
    return np.array(soon), np.array(late)


def _strays(records: Sequence[Record], measured: np.ndarray, rule: Rule) -> list[int]:
    """Return the rows of trials that lie far from the middle of their repeats.

    Of two repeats that far apart nobody knows which is wrong, so both go. `measured` is
    (n_trials, n_times, d), NaN where a trial has no sample.
    """
    rows, far = [], []
    for group in repeated(records, range(len(records))):
        distance = np.linalg.norm(
            measured[group] - _of_present(np.ma.median, measured[group]), axis=-1
        )
        rows += group
        far += _of_present(np.ma.mean, distance.T).tolist()
    deviation = np.nan_to_num(np.array(far))
    if not len(rows):
        return []
    middle = np.concatenate([r.measured - r.measured.mean(axis=0) for r in records])
    travel = float(np.sqrt((middle**2).sum(axis=1).mean()))
    limit = rule.stray * max(float(np.median(deviation)), rule.least_noise * travel)
    return sorted(row for row, d in zip(rows, deviation.tolist(), strict=True) if d > limit)


def _deviations(repeats: np.ndarray) -> np.ndarray:
    """Return distances (n, n_times) from the mean over axis 0, as if the true mean were known.

    `repeats` are (n, n_times, d), NaN where one has no sample. Their mean lies too near to each of
    them, on average √((n − 1)/n) as far as the true mean does, so each distance is multiplied by
    √(n/(n − 1)). A sample that no other repeat shares tells nothing and is NaN.
    """
    n = np.isfinite(repeats[..., 0]).sum(axis=0)
    distance = np.linalg.norm(repeats - _of_present(np.ma.mean, repeats), axis=-1)
    return np.where(n > 1, distance * np.sqrt(n / np.maximum(n - 1, 1)), np.nan)


def _of_present(mean: Callable[..., np.ma.MaskedArray], values: np.ndarray) -> np.ndarray:
    """Return the mean or median over axis 0 of what is not NaN; NaN where nothing is."""
    return mean(np.ma.masked_invalid(values), axis=0).filled(np.nan)
