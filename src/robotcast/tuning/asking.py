"""The one interface of every optimizer: it asks how parameter vectors do, and is told.

An optimizer never calls a simulator. It asks a `Question`, is told the `Answer`, and asks the
next, so that the budget, the trace, the journal and the bar are one and the same for all.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from robotcast.fitting.parameter import Parameter


@dataclass(frozen=True)
class Problem:
    """What an optimizer is given.

    Attributes
    ----------
    parameters : the free parameters.
    start : ndarray of shape (n_free,), where to start, each mapped to [0, 1] on its scale.
    casts : number of the casts to tune to.
    noise_percent : of cable length, the miss of a cast that says nothing: how far repeats lie
        apart, or what any simulator misses.
    """

    parameters: tuple[Parameter, ...]
    start: np.ndarray
    casts: int
    noise_percent: float


@dataclass(frozen=True)
class Question:
    """How do these parameter vectors do?

    Attributes
    ----------
    vectors : ndarray of shape (n_vectors, n_free), in [0, 1].
    casts : numbers of the casts to try them on, None for all.
    share : of each cast's waypoints, the first ones that are looked at.
    with_misses : ask for every waypoint's miss, not only for the error.
    """

    vectors: np.ndarray
    casts: tuple[int, ...] | None = None
    share: float = 1.0
    with_misses: bool = False

    @property
    def whole(self) -> bool:
        """Whether the answer is the error that tuning minimises."""
        return self.casts is None and self.share == 1.0

    def cost(self, casts: int) -> int:
        """Return how many casts are simulated for it, out of a set of `casts`.

        A cast counts as one however little of it is looked at.
        """
        return len(self.vectors) * (casts if self.casts is None else len(self.casts))


@dataclass(frozen=True)
class Answer:
    """How the vectors of a question did on its casts.

    Attributes
    ----------
    percent : ndarray of shape (n_vectors,), average waypoint error in % of cable length (paper,
        "Simulator Parameter Tuning"). A cast counts with one cable length at most, and with all
        of it where its run diverged.
    diverged : int ndarray of shape (n_vectors,), runs that diverged.
    misses : ndarray of shape (n_vectors, n_casts, D), if asked for: predicted − measured in % of
        cable length, over the root of a cast's number of waypoints, so that a cast's sum of
        squares is its mean square miss. 0 past its waypoints.
    """

    percent: np.ndarray
    diverged: np.ndarray
    misses: np.ndarray | None = None


Evaluate = Callable[[Question], Answer]


class Search(Protocol):
    """One run of an optimizer. `ask` and `tell` take turns; the first question is a whole one."""

    def ask(self) -> Question | None:
        """Return the next question, None when there is nothing more to ask."""
        ...

    def tell(self, answer: Answer) -> None:
        """Take in the answer to the question asked last."""
        ...

    def close(self) -> None:
        """End the search, whether or not it had more to ask."""
        ...


class Optimizer(Protocol):
    """Minimises the average waypoint error over the unit cube."""

    def begin(self, problem: Problem, budget_casts: int) -> Search:
        """Start a search. The same problem, budget and answers lead to the same questions.

        Whoever asks the questions ends it at the budget; an optimizer that goes in stages knows
        from it how long they may be.
        """
        ...
