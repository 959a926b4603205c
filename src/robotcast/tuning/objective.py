"""What tuning minimises: the average waypoint error of parameter vectors over casts."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from robotcast.fitting.parameter import Parameter
from robotcast.measurements.errors import cast_errors
from robotcast.measurements.measurement_set import Trial
from robotcast.simulators.simulator import Simulator
from robotcast.tuning.asking import Answer, Question

LEAST_NOISE_PERCENT = 0.3  # of cable length: what is missed less may as well be noise
DIVERGED_PERCENT = 100.0  # of cable length: what a run that diverged costs, and any run at most


class WaypointError:
    """Answers questions by simulating every cast under every vector in one call.

    Vectors hold the free parameters only, each mapped to [0, 1] on its scale. A run that
    diverges, or says nothing finite of a waypoint, costs a penalty and is counted.
    """

    def __init__(self, simulator: Simulator, trials: Sequence[Trial], length_m: float) -> None:
        self.free = tuple(p for p in simulator.parameters if not p.frozen)
        self._simulator = simulator
        self._trials = tuple(trials)
        self._length_m = length_m

    def __call__(self, question: Question) -> Answer:
        """Answer a question (see `Answer`)."""
        chosen = range(len(self._trials)) if question.casts is None else question.casts
        trials = [_beginning(self._trials[i], question.share) for i in chosen]
        vectors = full_vectors(self._simulator.parameters, question.vectors)
        predicted_m = self._simulator.simulate(trials, vectors).waypoints_m
        predicted_m = np.where(np.isfinite(predicted_m), predicted_m, np.nan)
        average_m = np.stack([cast_errors(paths_m, trials)[0] for paths_m in predicted_m])
        lost = np.isnan(average_m)
        percent = np.where(lost, DIVERGED_PERCENT, 100 / self._length_m * average_m)
        misses = self._misses(predicted_m, trials, lost) if question.with_misses else None
        counted = np.minimum(percent, DIVERGED_PERCENT).mean(axis=1)
        return Answer(counted, lost.sum(axis=1), misses)

    def _misses(
        self, predicted_m: np.ndarray, trials: Sequence[Trial], lost: np.ndarray
    ) -> np.ndarray:
        """Return the misses (n_vectors, n_casts, 2 k_max) of `Answer`; `lost` as predicted."""
        k_max = max(len(t.waypoints_s) for t in trials)
        misses = np.zeros((*predicted_m.shape[:2], k_max, 2))
        for i, trial in enumerate(trials):
            k = len(trial.waypoints_s)
            away_m = predicted_m[:, i, :k] - trial.waypoints_m
            misses[:, i, :k] = 100 / self._length_m * away_m / np.sqrt(k)
        misses[lost] = 0
        misses[lost, 0, 0] = DIVERGED_PERCENT
        return misses.reshape(*predicted_m.shape[:2], -1)


def _beginning(trial: Trial, share: float) -> Trial:
    """Return a trial that ends early, after this share of its waypoints."""
    if share == 1.0:
        return trial
    k = max(2, round(share * len(trial.waypoints_s)))
    return replace(trial, waypoints_s=trial.waypoints_s[:k], waypoints_m=trial.waypoints_m[:k])


def full_vectors(parameters: Sequence[Parameter], unit_vectors: np.ndarray) -> np.ndarray:
    """Turn unit vectors of the free parameters (n, n_free) into vectors of all (n, n_all)."""
    columns = iter(np.atleast_2d(unit_vectors).T)
    n = len(np.atleast_2d(unit_vectors))
    return np.stack(
        [
            np.full(n, p.nominal) if p.frozen else p.from_unit(np.clip(next(columns), 0, 1))
            for p in parameters
        ],
        axis=1,
    )
