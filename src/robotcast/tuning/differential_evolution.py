"""Differential evolution (Storn and Price 1997) as SciPy has it (paper, tuning)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import differential_evolution
from scipy.stats import qmc

from robotcast.tuning.search import Objective, Problem, Query


@dataclass(frozen=True)
class DifferentialEvolution:
    """Evolves a population; each generation is one query."""

    population: int  # vectors a generation, at least 5
    mutation: Sequence[float] = (0.5, 1.0)  # range of each generation's differential weight
    recombination: float = 0.9  # crossover probability
    seed: int = 0

    def minimise(self, problem: Problem, objective: Objective, budget_casts: int) -> None:
        """Search from a Latin hypercube with the problem's start as one of its vectors."""
        n = len(problem.start)
        first = qmc.LatinHypercube(n, rng=np.random.default_rng(self.seed)).random(self.population)
        first[0] = problem.start

        def percent(columns: np.ndarray) -> np.ndarray:
            return objective(Query(np.ascontiguousarray(columns.T))).percent

        try:
            differential_evolution(
                percent,
                bounds=[(0.0, 1.0)] * n,
                init=first,  # pyright: ignore[reportArgumentType]
                maxiter=10**9,  # the budget ends the search
                mutation=tuple(self.mutation),
                recombination=self.recombination,
                rng=np.random.default_rng(self.seed),
                updating="deferred",
                vectorized=True,
                polish=False,
                tol=0,
            )
        except RuntimeError as error:  # by which SciPy hides a ValueError of the objective
            raise error.__cause__ or error from None
