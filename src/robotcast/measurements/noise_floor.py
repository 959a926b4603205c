"""What no model can beat: how far repeats of one action lie from each other."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robotcast.fitting.resampling import at_times
from robotcast.measurements.measurement_set import MeasurementSet, Trial

GRID = 10  # times for each waypoint at most, whatever period_s says


@dataclass(frozen=True)
class NoiseFloor:
    """The errors that a perfect model would still show, estimated from repeats.

    Attributes
    ----------
    waypoint_percent, final_percent : average waypoint deviation and median final deviation in %
        of cable length, comparable with the two metrics of `errors`; None without repeats.
    n_actions, n_casts : how many actions were repeated and the casts they make together.
    """

    waypoint_percent: float | None
    final_percent: float | None
    n_actions: int
    n_casts: int

    def __str__(self) -> str:
        if self.waypoint_percent is None:
            return "the noise floor is unknown: no action was repeated"
        return (
            f"noise floor from {self.n_casts} repeats of {self.n_actions} actions: "
            f"average waypoint deviation {self.waypoint_percent:.2f} %, "
            f"median final deviation {self.final_percent:.2f} % of cable length"
        )


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
        return NoiseFloor(None, None, 0, 0)
    to_percent = 100 / measured.cable.length_m
    ends_m = [np.array([t.endpoint_m for t in group if t.rested]) for group in groups]
    final_m = np.concatenate([_deviations(e) for e in ends_m if len(e) > 1] or [[np.nan]])
    return NoiseFloor(
        waypoint_percent=float(average_m.mean() * to_percent),
        final_percent=float(np.median(final_m) * to_percent) if np.isfinite(final_m[0]) else None,
        n_actions=len(groups),
        n_casts=sum(len(group) for group in groups),
    )


def _average_deviations(group: Sequence[Trial], period_s: float) -> np.ndarray:
    """Return the average deviation of each repeat that shares times with others, (≤ n,)."""
    rows, last_s = (max(f(t.waypoints_s) for t in group) for f in (len, max))
    times_s = np.arange(0.0, last_s + period_s / 2, max(period_s, last_s / (GRID * rows)))
    paths_m = np.stack([at_times(times_s, t.waypoints_s, t.waypoints_m, period_s) for t in group])
    shared = np.isfinite(paths_m[..., 0]).sum(axis=0) > 1
    deviations_m = _deviations(paths_m[:, shared])
    sharing = np.isfinite(deviations_m).any(axis=1)
    return np.nanmean(deviations_m[sharing], axis=1)


def _deviations(repeats_m: np.ndarray) -> np.ndarray:
    """Return corrected distances from the mean over axis 0: (n, ..., 2) → (n, ...), NaN kept."""
    n = np.isfinite(repeats_m[..., 0]).sum(axis=0)
    distance_m = np.linalg.norm(repeats_m - np.nanmean(repeats_m, axis=0), axis=-1)
    return distance_m * np.sqrt(n / (n - 1))
