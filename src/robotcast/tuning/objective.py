"""What tuning minimises: the average waypoint error of parameter vectors over casts."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from robotcast.fitting.parameter import Parameter
from robotcast.measurements.errors import cast_errors
from robotcast.measurements.measurement_set import Trial
from robotcast.simulators.simulator import Simulator
from robotcast.tuning.search import Query, Response

LEAST_NOISE_PERCENT = 0.3  # of cable length: what is missed less may as well be noise
DIVERGED_PERCENT = 100.0  # of cable length: what a run that diverged costs, and any run at most


class WaypointError:
    """Simulates every cast under every vector of a query in one call.

    A run that diverges, or says nothing finite of a waypoint, costs a penalty and is counted.
    """

    def __init__(self, simulator: Simulator, trials: Sequence[Trial], length_m: float) -> None:
        self.free = tuple(p for p in simulator.parameters if not p.frozen)
        self._simulator = simulator
        self._trials = tuple(trials)
        self._length_m = length_m

    def __call__(self, query: Query) -> Response:
        """Answer a query (see `Response`)."""
        chosen = range(len(self._trials)) if query.casts is None else query.casts
        trials = [_beginning(self._trials[i], query.share) for i in chosen]
        vectors = full_vectors(self._simulator.parameters, query.vectors)
        predicted_m = self._simulator.simulate(trials, vectors).waypoints_m
        predicted_m = np.where(np.isfinite(predicted_m), predicted_m, np.nan)
        average_m = np.stack([cast_errors(paths_m, trials)[0] for paths_m in predicted_m])
        lost = np.isnan(average_m)
        percent = np.where(lost, DIVERGED_PERCENT, 100 / self._length_m * average_m)
        residuals = self._residuals(predicted_m, trials, lost) if query.with_residuals else None
        counted = np.minimum(percent, DIVERGED_PERCENT).mean(axis=1)
        return Response(counted, lost.sum(axis=1), residuals)

    def _residuals(
        self, predicted_m: np.ndarray, trials: Sequence[Trial], lost: np.ndarray
    ) -> np.ndarray:
        """Return the residuals (n_vectors, n_casts, 2 k_max) of `Response`; `lost` as predicted."""
        k_max = max(len(t.waypoints_s) for t in trials)
        residuals = np.zeros((*predicted_m.shape[:2], k_max, 2))
        for i, trial in enumerate(trials):
            k = len(trial.waypoints_s)
            away_m = predicted_m[:, i, :k] - trial.waypoints_m
            residuals[:, i, :k] = 100 / self._length_m * away_m / np.sqrt(k)
        residuals[lost] = 0
        residuals[lost, 0, 0] = DIVERGED_PERCENT
        return residuals.reshape(*predicted_m.shape[:2], -1)


def _beginning(trial: Trial, share: float) -> Trial:
    """Return a trial that ends early, after this share of its waypoints."""
    k = max(2, round(share * len(trial.waypoints_s)))
    return replace(trial, waypoints_s=trial.waypoints_s[:k], waypoints_m=trial.waypoints_m[:k])


def full_vectors(parameters: Sequence[Parameter], unit_vectors: np.ndarray) -> np.ndarray:
    """Turn unit vectors of the free parameters (n, n_free) into vectors of all (n, n_all)."""
    units = np.clip(np.atleast_2d(unit_vectors), 0, 1)
    full = np.tile(np.array([p.nominal for p in parameters], float), (len(units), 1))
    free = (i for i, p in enumerate(parameters) if not p.frozen)
    for i, column in zip(free, units.T, strict=True):
        full[:, i] = parameters[i].from_unit(column)
    return full
