"""How far predicted waypoints are from measured ones (paper, "Simulator Parameter Tuning")."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robotcast.measurements.measurement_set import Trial


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
