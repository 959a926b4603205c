"""Differential evolution (Storn and Price 1997) as SciPy has it (paper, tuning)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import differential_evolution
from scipy.stats import qmc

from robotcast.progress import Progress
from robotcast.tuning.objective import Objective
from robotcast.tuning.search import Found, Recorder


@dataclass(frozen=True)
class DifferentialEvolution:
    """Evolves a population; each generation is one batch.

    Attributes
    ----------
    population : vectors a generation, at least 5.
    generations : generations after the first population.
    mutation : range from which the differential weight is drawn each generation.
    recombination : crossover probability.
    """

    population: int
    generations: int
    mutation: Sequence[float] = (0.5, 1.0)
    recombination: float = 0.9
    seed: int = 0

    def run(self, objective: Objective, start: np.ndarray, progress: Progress) -> Found:
        """Search from a Latin hypercube with `start` (n_free,) as one of its vectors."""
        recorder = Recorder(objective, self.generations + 1, progress)
        cube = qmc.LatinHypercube(len(start), rng=np.random.default_rng(self.seed))
        first = cube.random(self.population)
        first[0] = start
        differential_evolution(
            lambda columns: recorder(np.ascontiguousarray(columns.T)),
            bounds=[(0.0, 1.0)] * len(start),
            init=first,  # pyright: ignore[reportArgumentType]
            maxiter=self.generations,
            mutation=tuple(self.mutation),
            recombination=self.recombination,
            rng=np.random.default_rng(self.seed),
            updating="deferred",
            vectorized=True,
            polish=False,
            tol=0,
        )
        return recorder.found()
