"""The loop round every optimizer: its budget, its trace and the best vector of all."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from robotcast.tuning.asking import Answer, Evaluate, Optimizer, Problem, Question


@dataclass(frozen=True)
class Batch:
    """One answered question, as the trace shows it.

    Attributes
    ----------
    casts : simulated for it.
    best_percent : best error so far of a vector that was tried on all casts.
    median_percent : of the batch, on the casts that it was tried on.
    diverged : runs that diverged.
    """

    casts: int
    best_percent: float
    median_percent: float
    diverged: int


@dataclass(frozen=True)
class Found:
    """The best vector of a search.

    Attributes
    ----------
    vector : ndarray of shape (n_free,), in [0, 1].
    percent : its average waypoint error, % of cable length.
    trace : every answered question in order.
    """

    vector: np.ndarray
    percent: float
    trace: tuple[Batch, ...]

    @property
    def casts(self) -> int:
        """How many casts were simulated."""
        return sum(batch.casts for batch in self.trace)

    @property
    def improved(self) -> bool:
        """Whether it went on to anything better than its first question."""
        return self.percent < self.trace[0].best_percent


def search(
    optimizer: Optimizer,
    problem: Problem,
    evaluate: Evaluate,
    budget_casts: int,
    look: Callable[[Sequence[Batch]], None] = lambda trace: None,
) -> Found:
    """Answer an optimizer's questions until it has none left or the budget cannot pay the next.

    Parameters
    ----------
    budget_casts : the most casts that may be simulated.
    look : told the trace after each batch.

    Raises
    ------
    ValueError
        When the budget does not pay the first question, or that is not about all casts.
    """
    found: Found | None = None
    asked = optimizer.begin(problem, budget_casts)
    try:
        while (question := asked.ask()) is not None:
            cost = question.cost(problem.casts)
            if found is None:
                _check_first(question, cost, budget_casts)
            elif found.casts + cost > budget_casts:
                break
            answer = evaluate(question)
            asked.tell(answer)
            found = _after(found, question, answer, cost)
            look(found.trace)
    finally:
        asked.close()
    if found is None:
        raise ValueError("an optimizer must ask at least one question")
    return found


def _check_first(question: Question, cost: int, budget_casts: int) -> None:
    if not question.whole:
        raise ValueError("an optimizer's first question must be about all casts")
    if cost > budget_casts:
        raise ValueError(
            f"the first batch takes {cost} simulated casts, the budget is {budget_casts}: "
            "raise optimizer.budget_casts or make the batch smaller"
        )


def _after(before: Found | None, question: Question, answer: Answer, cost: int) -> Found:
    """Return what is known after one more answer."""
    trace = () if before is None else before.trace
    best = int(np.argmin(answer.percent))
    percent = float(answer.percent[best])
    if before is None or (question.whole and percent < before.percent):
        vector = question.vectors[best].copy()
    else:
        vector, percent = before.vector, before.percent
    batch = Batch(
        casts=cost,
        best_percent=percent,
        median_percent=float(np.median(answer.percent)),
        diverged=int(answer.diverged.sum()),
    )
    return Found(vector, percent, (*trace, batch))
