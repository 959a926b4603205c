"""What every optimizer shares: what it is given and what it returns."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from robotcast.progress import Progress
from robotcast.tuning.objective import Objective, Scores


@dataclass(frozen=True)
class Batch:
    """One evaluated batch of a search, as the trace shows it."""

    vectors: int
    best_percent: float
    median_percent: float
    diverged: int


def batch_of(scores: Scores, best_before: float) -> Batch:
    """Return a batch as the trace shows it; `best_before` is the best of the batches before."""
    return Batch(
        vectors=len(scores.percent),
        best_percent=min(best_before, float(scores.percent.min())),
        median_percent=float(np.median(scores.percent)),
        diverged=int(scores.diverged.sum()),
    )


@dataclass(frozen=True)
class Found:
    """The best vector of a search.

    Attributes
    ----------
    unit_vector : ndarray of shape (n_free,), in [0, 1].
    percent : its average waypoint error, % of cable length.
    trace : every evaluated batch in order; `best_percent` is the best so far.
    """

    unit_vector: np.ndarray
    percent: float
    trace: tuple[Batch, ...]


class Search(Protocol):
    """Minimises an objective over the unit cube."""

    def run(self, objective: Objective, start: np.ndarray, progress: Progress) -> Found:
        """Search from `start` (n_free,); every call of the objective is one batch."""
        ...


class Recorder:
    """Wraps an objective: keeps the trace and the best vector of all batches."""

    def __init__(self, objective: Objective, n_batches: int, progress: Progress) -> None:
        self._objective = objective
        self._n_batches = n_batches
        self._progress = progress
        self.trace: list[Batch] = []
        self.best_vector = np.empty(0)
        self.best_percent = np.inf

    def __call__(self, unit_vectors: np.ndarray) -> np.ndarray:
        """Score unit vectors (n_vectors, n_free); return their errors (n_vectors,)."""
        scores = self._objective(unit_vectors)
        best = int(np.argmin(scores.percent))
        if scores.percent[best] < self.best_percent:
            self.best_percent = float(scores.percent[best])
            self.best_vector = unit_vectors[best].copy()
        self.trace.append(batch_of(scores, self.best_percent))
        self._progress(len(self.trace), self._n_batches, f"best {self.best_percent:.2f} %")
        return scores.percent

    def found(self) -> Found:
        """Return the best of everything evaluated."""
        return Found(self.best_vector, self.best_percent, tuple(self.trace))
