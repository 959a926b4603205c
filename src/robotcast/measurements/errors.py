"""How far predicted waypoints are from measured ones (paper, "Simulator Parameter Tuning").

And what no model can beat: how far repeats of one action lie from each other.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robotcast.fitting.resampling import at_times
from robotcast.measurements.measurement_set import MeasurementSet, Trial

GRID = 10  # times for each waypoint at most, whatever period_s says


@dataclass(frozen=True)
class PredictionErrors:
    """The paper's two metrics over a set of casts, in m and in % of cable length.

    The L² distance averaged over a cast's tracked waypoints, then over casts; and the median of
    that at the last one, over the casts whose end was seen at rest (over all where none was).
    """

    waypoint_m: float
    final_m: float
    waypoint_percent: float
    final_percent: float
    standard_error_percent: float | None  # of `waypoint_percent`, None of a single cast
    n_casts: int
    n_diverged: int  # each counts with an error of one cable length


def cast_errors(predicted_m: np.ndarray, trials: Sequence[Trial]) -> tuple[np.ndarray, np.ndarray]:
    """Return every cast's average waypoint error and final error, each (n_casts,) [m].

    Both are NaN for a cast whose prediction lacks one of its waypoints: its run diverged.
    Waypoint j of cast i in `predicted_m` (n_casts, k_max, 2) belongs to
    `trials[i].waypoints_s[j]`, so frames lost by the tracker take no part.
    """
    k_most = max((len(t.waypoints_s) for t in trials), default=0)
    if len(predicted_m) != len(trials) or predicted_m.shape[1] < k_most:
        raise ValueError(
            f"expected predictions for {len(trials)} casts with up to {k_most} waypoints, "
            f"got an array of shape {predicted_m.shape}"
        )
    average_m, final_m = np.empty((2, len(trials)))
    for i, (predicted, trial) in enumerate(zip(predicted_m, trials, strict=True)):
        away_m = predicted[: len(trial.waypoints_m)] - trial.waypoints_m
        distance_m = np.linalg.norm(away_m, axis=-1)
        average_m[i], final_m[i] = distance_m.mean(), distance_m[-1]
    return average_m, np.where(np.isnan(average_m), np.nan, final_m)


def prediction_errors(
    predicted_m: np.ndarray, trials: Sequence[Trial], length_m: float
) -> PredictionErrors:
    """Return the metrics of predictions (n_casts, k_max, 2) for a cable of `length_m`."""
    if not trials:
        raise ValueError("errors need at least one cast")
    average_m, final_m = cast_errors(predicted_m, trials)
    diverged = np.isnan(average_m)
    average_m = np.where(diverged, length_m, average_m)
    waypoint_m, n = float(average_m.mean()), len(trials)
    percent = 100 / length_m
    standard_error = percent * float(average_m.std(ddof=1)) / math.sqrt(n) if n > 1 else None
    counts = np.array([trial.rested for trial in trials])
    counts |= not counts.any()
    median_m = float(np.median(np.where(diverged, length_m, final_m)[counts]))
    return PredictionErrors(
        waypoint_m=waypoint_m,
        final_m=median_m,
        waypoint_percent=percent * waypoint_m,
        final_percent=percent * median_m,
        standard_error_percent=standard_error,
        n_casts=n,
        n_diverged=int(diverged.sum()),
    )


@dataclass(frozen=True)
class NoiseFloor:
    """The errors that a perfect model would still show, in % of cable length.

    The average waypoint deviation and the median final one; None without repeats.
    """

    waypoint_percent: float | None = None
    final_percent: float | None = None


def noise_floor(measured: MeasurementSet) -> NoiseFloor:
    """Estimate the noise floor from the casts that repeat an action.

    A perfect model predicts the mean path μ of an action and misses repeat p_j by |p_j − μ|.
    The mean of only n repeats stands in for μ and lies too near to each of them: for normal
    scatter |p_j − p̄| is on average √((n − 1)/n) times |p_j − μ|, so every deviation is
    multiplied by √(n/(n − 1)). Paths are compared every camera period, between waypoints on a
    spline through them; a time counts where at least two repeats were tracked, with n the repeats
    tracked there. The final deviation compares the endpoints of those seen at rest.
    """
    repeats: dict[int, list[Trial]] = {}
    for trial in measured.trials:
        repeats.setdefault(trial.action_id, []).append(trial)
    groups = [group for group in repeats.values() if len(group) > 1]
    averages_m = [_average_deviations(group, measured.period_s) for group in groups]
    average_m = np.concatenate([*averages_m, np.empty(0)])
    if len(average_m) == 0:
        return NoiseFloor()
    to_percent = 100 / measured.cable.length_m
    ends_m = [np.array([t.endpoint_m for t in group if t.rested]) for group in groups]
    final_m = np.concatenate([deviations(e) for e in ends_m if len(e) > 1] or [[np.nan]])
    final = float(np.median(final_m) * to_percent) if np.isfinite(final_m[0]) else None
    return NoiseFloor(float(average_m.mean() * to_percent), final)


def _average_deviations(group: Sequence[Trial], period_s: float) -> np.ndarray:
    """Return the average deviation of each repeat that shares times with others, (≤ n,)."""
    rows, last_s = (max(f(t.waypoints_s) for t in group) for f in (len, max))
    times_s = np.arange(0.0, last_s + period_s / 2, max(period_s, last_s / (GRID * rows)))
    paths_m = np.stack([at_times(times_s, t.waypoints_s, t.waypoints_m, period_s) for t in group])
    shared = np.isfinite(paths_m[..., 0]).sum(axis=0) > 1
    deviations_m = deviations(paths_m[:, shared])
    sharing = np.isfinite(deviations_m).any(axis=1)
    return np.nanmean(deviations_m[sharing], axis=1)


def deviations(repeats_m: np.ndarray) -> np.ndarray:
    """Return corrected distances from the mean over axis 0: (n, ..., 2) → (n, ...), NaN kept."""
    n = np.isfinite(repeats_m[..., 0]).sum(axis=0)
    distance_m = np.linalg.norm(repeats_m - np.nanmean(repeats_m, axis=0), axis=-1)
    return distance_m * np.sqrt(n / (n - 1))
