"""Bayesian optimization (Frazier 2018) of the log error with BoTorch (paper, tuning)."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import qmc

from robotcast.tuning.asking import Answer, Problem, Question, Search
from robotcast.tuning.surrogate import ACQUISITIONS, Acquisition, most_promising

LEAST_PERCENT = 1e-6  # below it, errors are alike: the logarithm needs more than 0


@dataclass(frozen=True)
class BayesianOptimization:
    """Asks for the vectors that a Gaussian process of the log error calls most promising.

    Attributes
    ----------
    initial : vectors of the Latin hypercube that it starts from.
    batch : vectors a question afterwards.
    most : vectors after which it ends, whatever its budget.
    acquisition : "ei" expected improvement, "lcb" lower confidence bound, "mpi" maximum
        probability of improvement.
    improvement : by how much a vector must be better to count as an improvement ("ei", "mpi"),
        in standard deviations of the log errors seen so far.
    exploration : how many standard deviations below the mean the bound lies ("lcb").
    raw_samples, restarts : vectors at which the acquisition is first looked at, and those of
        them from which it is climbed.
    """

    initial: int
    batch: int
    most: int
    acquisition: str = "ei"
    improvement: float = 0.01
    exploration: float = 2.0
    raw_samples: int = 256
    restarts: int = 6
    seed: int = 0

    def __post_init__(self) -> None:
        if self.acquisition not in ACQUISITIONS:
            known = ", ".join(ACQUISITIONS)
            raise ValueError(f"acquisition {self.acquisition} is unknown: expected {known}")
        if self.initial < 2 or self.batch < 1:
            raise ValueError(
                "Bayesian optimization needs 2 initial vectors and 1 a batch, "
                f"got {self.initial} and {self.batch}"
            )

    def begin(self, problem: Problem, budget_casts: int) -> Search:
        """Search from a Latin hypercube with the problem's start as one of its vectors."""
        return _Run(self, problem)


class _Run:
    """A search under way."""

    def __init__(self, settings: BayesianOptimization, problem: Problem) -> None:
        self._settings = settings
        self._start = problem.start
        self._asked = np.empty((0, len(problem.start)))
        self._vectors = self._asked
        self._loss = np.empty(0)

    def ask(self) -> Question | None:
        """Return the next vectors, None when it has tried as many as it may."""
        if len(self._loss) >= self._settings.most:
            return None
        self._asked = self._promising() if len(self._loss) else self._first()
        return Question(self._asked)

    def tell(self, answer: Answer) -> None:
        """Take in how the vectors did."""
        self._vectors = np.vstack([self._vectors, self._asked])
        loss = np.log(np.maximum(answer.percent, LEAST_PERCENT))
        self._loss = np.concatenate([self._loss, loss])

    def close(self) -> None:
        """Leave it: nothing runs between two questions."""

    def _first(self) -> np.ndarray:
        rng = np.random.default_rng(self._settings.seed)
        vectors = qmc.LatinHypercube(len(self._start), rng=rng).random(self._settings.initial)
        vectors[0] = self._start
        return vectors

    def _promising(self) -> np.ndarray:
        settings = self._settings
        return most_promising(
            self._vectors,
            self._loss,
            Acquisition(settings.acquisition, settings.improvement, settings.exploration),
            wanted=settings.batch,
            raw_samples=settings.raw_samples,
            restarts=settings.restarts,
            seed=settings.seed + len(self._loss),
        )
