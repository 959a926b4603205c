"""Looking on while a search runs, whatever the search."""

from collections.abc import Callable, Sequence

import numpy as np

from robotcast.tuning.objective import Objective, Scores
from robotcast.tuning.search import Batch, batch_of


class Watched:
    """Answers like `objective` and tells `look` all batches so far after each of them."""

    def __init__(self, objective: Objective, look: Callable[[Sequence[Batch]], None]) -> None:
        self._objective = objective
        self._look = look
        self._trace: list[Batch] = []

    def __call__(self, unit_vectors: np.ndarray) -> Scores:
        """Score unit vectors (n_vectors, n_free)."""
        scores = self._objective(unit_vectors)
        best = self._trace[-1].best_percent if self._trace else np.inf
        self._trace.append(batch_of(scores, best))
        self._look(tuple(self._trace))
        return scores
