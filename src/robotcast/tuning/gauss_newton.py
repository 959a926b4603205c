"""Gauss–Newton least squares on finite differences, from a start that an ensemble finds.

Steps and differences: Nocedal and Wright 2006, ch. 10; the start: Iglesias, Law and Stuart 2013.
"""

import math
from dataclasses import dataclass

import numpy as np

from robotcast.fitting.ensemble import ensemble_start
from robotcast.fitting.least_squares import (
    ENOUGH,
    Fit,
    Prior,
    Residuals,
    difference_steps,
    fit_robustly,
)
from robotcast.fitting.starts import hypercube, spread
from robotcast.tuning.asking import Evaluate, Problem, Question, Search
from robotcast.tuning.called import Called

LEG = 2  # iterations of the last fit, after which it is looked at
FAR = 1.15  # ½ ln(1 + 3²), the loss of casts missed by three noises: perhaps in a wrong valley
HOPE = 0.1  # of its loss that a fit so far off must shed in a leg; in a wrong valley it creeps
WIDE = 10.0  # ranges: an expectation so wide only keeps what the casts do not tell where it is
ALL_OVER = 0.96  # of every range: where the starts may lie


@dataclass(frozen=True)
class GaussNewton:
    """Fits every waypoint at once; a Jacobian or all tried steps are one question each.

    An ensemble looks for a start on the beginnings of a few casts, a fit to those of some more
    follows and goes on with all casts, until a step hardly pays. A search that ends far above the
    noise, or creeps there, begins again with another ensemble.

    Attributes
    ----------
    members, updates : of the ensemble, the problem's start among its members.
    few, some : casts that the ensemble sees, and those that the first fit does.
    share : of each cast's waypoints that these see.
    early_iterations, iterations : of the first fit and of the last one, at most.
    attempts : searches at most, the first included.
    """

    members: int
    updates: int
    few: int
    some: int
    share: float
    early_iterations: int
    iterations: int
    attempts: int
    seed: int = 0

    def begin(self, problem: Problem) -> Search:
        """Search from the problem's start and from others all over the ranges."""
        return Called(lambda evaluate: self._run(problem, evaluate))

    def _run(self, problem: Problem, evaluate: Evaluate) -> None:
        evaluate(Question(problem.start[None]))
        for attempt in range(self.attempts):
            last = attempt == self.attempts - 1
            if self._fitted(problem, evaluate, self.seed + attempt, patient=last).loss < FAR:
                return

    def _fitted(self, problem: Problem, evaluate: Evaluate, seed: int, *, patient: bool) -> Fit:
        """Return where a search ends; unless `patient`, one that creeps far away ends early."""
        noise = problem.noise_percent
        early = _Fits(problem, _residuals(evaluate, noise, self.share), self.some)
        whole = _Fits(problem, _residuals(evaluate, noise), problem.casts)
        members = hypercube(np.full(len(problem.start), 0.5), ALL_OVER, self.members, seed)
        members[0] = problem.start
        few = spread(early.trials, self.few)
        start = ensemble_start(early.residuals, members, few, self.updates, seed)
        begun = early(start, self.early_iterations)
        fit, before = begun, math.inf
        for done in range(0, self.iterations, LEG):
            fit = whole(fit.vector, min(LEG, self.iterations - done), like=fit)
            least = HOPE if fit.loss > FAR and not patient else ENOUGH
            if fit.loss > before * (1 - least):
                break
            before = fit.loss
        return fit


class _Fits:
    """Fits to some of a problem's casts, evenly spaced."""

    def __init__(self, problem: Problem, residuals: Residuals, casts: int) -> None:
        self.residuals = residuals
        self.trials = spread(np.arange(problem.casts), casts)
        self._steps = difference_steps(problem.parameters)
        self._prior = Prior(problem.start, np.full(len(problem.start), WIDE))

    def __call__(self, start: np.ndarray, iterations: int, *, like: Fit | None = None) -> Fit:
        return fit_robustly(
            self.residuals,
            start,
            self._steps,
            self.trials,
            iterations=iterations,
            like=like,
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
