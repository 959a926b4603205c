"""What tuning minimises: the average waypoint error of parameter vectors over casts."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from robotcast.fitting.parameter import Parameter
from robotcast.measurements.errors import prediction_errors
from robotcast.measurements.measurement_set import Trial
from robotcast.progress import Progress, silent
from robotcast.simulators.simulator import Simulator


@dataclass(frozen=True)
class Scores:
    """How a batch of parameter vectors did.

    Attributes
    ----------
    percent : ndarray of shape (n_vectors,), average waypoint error in % of cable length
        (paper, "Simulator Parameter Tuning"); a diverged run counts as one cable length.
    diverged : int ndarray of shape (n_vectors,), runs that diverged.
    """

    percent: np.ndarray
    diverged: np.ndarray


Objective = Callable[[np.ndarray], Scores]


class WaypointError:
    """Scores parameter vectors by simulating every trial under every vector in one call.

    Vectors hold the free parameters only, each mapped to [0, 1] on its scale.
    """

    def __init__(
        self,
        simulator: Simulator,
        trials: Sequence[Trial],
        length_m: float,
        progress: Progress = silent,
    ) -> None:
        self.free = tuple(p for p in simulator.parameters if not p.frozen)
        self._simulator = simulator
        self._trials = tuple(trials)
        self._length_m = length_m
        self._progress = progress

    def __call__(self, unit_vectors: np.ndarray) -> Scores:
        """Score unit vectors of shape (n_vectors, n_free)."""
        vectors = full_vectors(self._simulator.parameters, unit_vectors)
        prediction = self._simulator.simulate(self._trials, vectors, progress=self._progress)
        errors = [
            prediction_errors(predicted, self._trials, self._length_m)
            for predicted in prediction.waypoints_m
        ]
        return Scores(
            np.array([e.waypoint_percent for e in errors]), prediction.diverged.sum(axis=1)
        )


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
