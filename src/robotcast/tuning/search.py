"""A search for the parameters with the least error: what an optimizer is given, calls and ends in.

An optimizer never calls a simulator. It sends a `Query` to the objective that `search` hands it and
gets the `Response`, so that budget, trace, journal and progress bar are the same for all. The
journal keeps what was asked and told on disk: an optimizer asks the same queries again when it is
told the same responses, so that a search that was killed goes on, and ends as an unbroken one.
"""

import json
import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Protocol

import numpy as np

from robotcast.files import discard_unfinished, write_text
from robotcast.fitting.parameter import Parameter


@dataclass(frozen=True)
class Problem:
    """What an optimizer is given."""

    parameters: tuple[Parameter, ...]  # the free ones
    start: np.ndarray  # (n_free,), each mapped to [0, 1] on its scale
    casts: int  # how many to tune to
    # of cable length, the miss of a cast that says nothing: how far repeats lie apart, or what any
    # simulator misses
    noise_percent: float


@dataclass(frozen=True)
class Query:
    """Parameter vectors to try."""

    vectors: np.ndarray  # (n_vectors, n_free), in [0, 1]
    casts: tuple[int, ...] | None = None  # numbers of those to try them on, None for all
    share: float = 1.0  # of each cast's waypoints, the first ones that are looked at
    with_residuals: bool = False  # whether the residual of every waypoint is asked for

    @property
    def whole(self) -> bool:
        """Whether the response is the error that tuning minimises."""
        return self.casts is None and self.share == 1.0

    def cost(self, casts: int) -> int:
        """Return how many casts it simulates of a set of `casts`, each in whole."""
        return len(self.vectors) * (casts if self.casts is None else len(self.casts))


@dataclass(frozen=True)
class Response:
    """How the vectors of a query did on its casts, in % of cable length.

    The error is the average waypoint error (paper, "Simulator Parameter Tuning"); a cast counts
    with 100 at most, and with all of it where its run diverged. Residuals are predicted − measured,
    x and y of each waypoint in turn, over the root of a cast's number of waypoints, so that its sum
    of squares is its mean square: 0 past its waypoints; 100, 0, 0, … where its run diverged.
    """

    percent: np.ndarray  # (n_vectors,), errors
    diverged: np.ndarray  # (n_vectors,), how many runs
    residuals: np.ndarray | None = None  # (n_vectors, n_casts, D), if asked for


Objective = Callable[[Query], Response]


def residuals_at(objective: Objective, query: Query) -> np.ndarray:
    """Return the residuals (n_vectors, n_casts, D) of a query's vectors."""
    residuals = objective(replace(query, with_residuals=True)).residuals
    assert residuals is not None  # they were asked for
    return residuals


class Optimizer(Protocol):
    """Minimises the average waypoint error over the unit cube."""

    def minimise(self, problem: Problem, objective: Objective, budget_casts: int) -> None:
        """Query the objective, of whole casts first, until nothing better is expected.

        `search` ends it at the budget, by an exception that it lets pass. The same problem, budget
        and responses must lead to the same queries.
        """


@dataclass(frozen=True)
class Batch:
    """One query that was answered."""

    casts: int  # simulated
    best_percent: float  # so far, of a vector that was tried on all casts
    median_percent: float  # of the batch, on the casts that it was tried on
    diverged: int  # of the casts


@dataclass(frozen=True)
class SearchResult:
    """The best vector (n_free,) of a search, in [0, 1], its error in %, and every batch."""

    vector: np.ndarray
    percent: float
    trace: tuple[Batch, ...]

    @property
    def casts(self) -> int:
        """How many casts were simulated."""
        return sum(batch.casts for batch in self.trace)

    @property
    def improved(self) -> bool:
        """Whether it went on to anything better than its first batch."""
        return self.percent < self.trace[0].best_percent


class _BudgetSpent(Exception):
    """The next query would cost more than what is left."""


def search(
    optimizer: Optimizer,
    problem: Problem,
    objective: Objective,
    budget_casts: int,
    on_batch: Callable[[Sequence[Batch]], None] = lambda trace: None,
) -> SearchResult:
    """Let an optimizer minimise until it ends or the budget of casts cannot pay its next query.

    `on_batch` is called with the trace after each batch. Raises ValueError when the budget does
    not pay the first query, or that is not about all casts.
    """
    result: SearchResult | None = None

    def counted(query: Query) -> Response:
        nonlocal result
        cost = query.cost(problem.casts)
        if result is None and not query.whole:
            raise ValueError("an optimizer's first query must be about all casts")
        if result is None and cost > budget_casts:
            raise ValueError(
                f"the first batch takes {cost} simulated casts, the budget is {budget_casts}: "
                "raise optimizer.budget_casts or make the batch smaller"
            )
        if result is not None and result.casts + cost > budget_casts:
            raise _BudgetSpent
        response = objective(query)
        result = _updated(result, query, response, cost)
        on_batch(result.trace)
        return response

    with suppress(_BudgetSpent):
        optimizer.minimise(problem, counted, budget_casts)
    if result is None:
        raise ValueError("an optimizer must send at least one query")
    return result


def _updated(
    before: SearchResult | None, query: Query, response: Response, cost: int
) -> SearchResult:
    trace = before.trace if before else ()
    best = int(np.argmin(response.percent))
    vector, percent = query.vectors[best].copy(), float(response.percent[best])
    if before and not (query.whole and percent < before.percent):
        vector, percent = before.vector, before.percent
    median = float(np.median(response.percent))
    batch = Batch(cost, percent, median, int(response.diverged.sum()))
    return SearchResult(vector, percent, (*trace, batch))


class Journal:
    """Answers queries from a file of past responses; one of another `subject` is started afresh.

    Its first line names the subject: data, simulator and settings. Two lines follow for each
    query, itself and its response, in JSON, which keeps numbers to the last bit.
    """

    def __init__(self, path: Path, subject: str, objective: Objective) -> None:
        self._path, self._objective = path, objective
        head, lines = json.dumps({"subject": subject}), list[str]()
        if path.exists():
            lines = path.read_text(encoding="utf-8").split("\n")[:-1]  # without a torn end
        pairs = zip(lines[1::2], lines[2::2], strict=False) if lines[:1] == [head] else ()
        self._known = dict(pairs)
        discard_unfinished(path.parent, path.name)
        write_text(path, "\n".join([head, *chain(*self._known.items()), ""]))

    def __call__(self, query: Query) -> Response:
        """Answer a query, from the file where it has it."""
        asked = _line(query)
        if told := self._known.get(asked):
            return Response(**{k: v and np.array(v) for k, v in json.loads(told).items()})
        response = self._objective(query)
        line = self._known[asked] = _line(response)
        with self._path.open("a", encoding="utf-8") as file:
            file.write(f"{asked}\n{line}\n")
            file.flush()
            os.fsync(file.fileno())
        return response

    def close(self) -> None:
        """Remove the file: the search has ended."""
        self._path.unlink(missing_ok=True)


def _line(entry: Query | Response) -> str:
    return json.dumps(asdict(entry), default=np.ndarray.tolist)
