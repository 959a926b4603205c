"""Gauss–Newton least squares on finite differences, from several starts (Nocedal and Wright)."""

from dataclasses import dataclass

import numpy as np

from robotcast.fitting.elimination import (
    Rounds,
    best_first,
    fit_by_elimination,
    hypercube,
    spread,
)
from robotcast.fitting.least_squares import (
    Fit,
    Prior,
    Residuals,
    difference_steps,
    fit_robustly,
)
from robotcast.tuning.asking import Evaluate, Problem, Question, Search
from robotcast.tuning.called import Called

WIDE = 10.0  # ranges: an expectation so wide only keeps what the casts do not tell where it is
ALL_OVER = 0.96  # of every range: where the starts may lie


@dataclass(frozen=True)
class GaussNewton:
    """Fits every waypoint at once; a Jacobian or all tried steps are one question each.

    Starts are looked at and fitted on the beginnings of some casts; the best few go on to all
    casts. It ends by itself when a step hardly pays.

    Attributes
    ----------
    looked_at : vectors of the first look, the problem's start among them.
    few, some : casts of the first look, and of the fits that follow it.
    share : of each cast's waypoints that these see.
    rounds : how many fits take part in each round (see `Rounds`).
    iterations : of the last fit, at most.
    """

    looked_at: int
    few: int
    some: int
    share: float
    rounds: Rounds
    iterations: int
    seed: int = 0

    def begin(self, problem: Problem) -> Search:
        """Search from the problem's start and from others all over the ranges."""
        return Called(lambda evaluate: self._run(problem, evaluate))

    def _run(self, problem: Problem, evaluate: Evaluate) -> None:
        evaluate(Question(problem.start[None]))
        noise = problem.noise_percent
        early = _Fits(problem, _residuals(evaluate, noise, self.share), self.some)
        starts = hypercube(np.full(len(problem.start), 0.5), ALL_OVER, self.looked_at, self.seed)
        starts[0] = problem.start
        starts = best_first(early.residuals, spread(early.trials, self.few), starts)
        whole = _Fits(problem, _residuals(evaluate, noise), problem.casts)
        fit_by_elimination(early, whole, starts, self.iterations, self.rounds)


class _Fits:
    """Fits to some of a problem's casts, evenly spaced."""

    def __init__(self, problem: Problem, residuals: Residuals, casts: int) -> None:
        self.residuals = residuals
        self.trials = spread(np.arange(problem.casts), casts)
        self._steps = difference_steps(problem.parameters)
        self._prior = Prior(problem.start, np.full(len(problem.start), WIDE))

    def __call__(self, start: np.ndarray, iterations: int, *, known: Fit | None = None) -> Fit:
        return fit_robustly(
            self.residuals,
            start,
            self._steps,
            self.trials,
            iterations=iterations,
            known=known,
            prior=self._prior,
        )


def _residuals(evaluate: Evaluate, noise_percent: float, share: float | None = None) -> Residuals:
    """Return the misses as a fit wants them, of the beginnings or, by default, of whole casts."""

    def of(vectors: np.ndarray, trials: np.ndarray) -> np.ndarray:
        if share is None:
            question = Question(vectors, with_misses=True)
        else:
            question = Question(vectors, tuple(trials.tolist()), share, with_misses=True)
        misses = evaluate(question).misses
        if misses is None:
            raise ValueError("least squares need the miss of every waypoint")
        return misses / noise_percent

    return of
