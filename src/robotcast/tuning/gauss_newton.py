"""Gauss–Newton least squares on finite differences, from a start that an ensemble finds.

Steps and differences: Nocedal and Wright 2006, ch. 10; the start: Iglesias, Law and Stuart 2013.
"""

from dataclasses import dataclass

import numpy as np

from robotcast.fitting.ensemble import ensemble_start
from robotcast.fitting.least_squares import (
    ENOUGH,
    Fit,
    Prior,
    Residuals,
    Stepping,
    difference_steps,
    fit_robustly,
    miss_unit,
    trial_losses,
)
from robotcast.fitting.starts import hypercube, spread
from robotcast.tuning.asking import Evaluate, Problem, Question, Search
from robotcast.tuning.called import Called

FAR = 1.15  # ½ ln(1 + 3²), the loss of casts missed by three noises: perhaps in a wrong valley
HOPE = 0.1  # of its loss that a fit so far off must shed; in a wrong valley it creeps
LOST = 3.0  # times the loss of the beginnings, on whole casts, in a wrong valley
CLEAR = 1e-5  # loss of casts missed by 0.004 noises: nothing is left to tell parameters by
WIDE = 10.0  # ranges: an expectation so wide only keeps what the casts do not tell where it is
ALL_OVER = 0.96  # of every range: where the starts may lie
# Casts that the model itself makes up have no noise; their misses lead along narrow curved valleys.
LEAST_UNIT = 0.01  # noises by which casts are judged there, at least
NEARER = (1.0, 0.25, 4.0)  # median misses; each Jacobian looks by the next of these lengths
MOST = 6  # steps for one Jacobian


@dataclass(frozen=True)
class GaussNewton:
    """Fits every waypoint at once; a Jacobian or all tried steps are one question each.

    An ensemble looks for a start on the beginnings of a few casts, a fit to those of some more
    follows and goes on with all casts, until a step hardly pays or the misses are far below the
    noise. A search begins again with another ensemble where the beginnings stay far above the
    noise, or whole casts do; the last one goes on from the best beginnings at any rate.

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
        whole = _Fits(problem, _residuals(evaluate, problem.noise_percent), problem.casts)
        far: list[Fit] = []
        for attempt in range(self.attempts):
            last = attempt == self.attempts - 1
            begun = self._begun(problem, evaluate, self.seed + attempt)
            if begun.loss > FAR:
                far.append(begun)
                if not last:
                    continue
                begun = min(far, key=lambda fit: fit.loss)
            if self._finished(whole, begun, patient=last).loss < FAR:
                return

    def _begun(self, problem: Problem, evaluate: Evaluate, seed: int) -> Fit:
        """Return a fit to the beginnings of some casts, from where an ensemble centres."""
        residuals = _residuals(evaluate, problem.noise_percent, self.share)
        fits = _Fits(problem, residuals, self.some)
        members = hypercube(np.full(len(problem.start), 0.5), ALL_OVER, self.members, seed)
        members[0] = problem.start
        few = spread(fits.trials, self.few)
        return fits(
            ensemble_start(residuals, members, few, self.updates, seed), self.early_iterations
        )

    def _finished(self, whole: "_Fits", begun: Fit, *, patient: bool) -> Fit:
        """Return where a fit to whole casts ends; unless `patient`, one without hope ends early."""
        fit, idle = begun, 0
        for turn in range(self.iterations):
            before, fit = fit, whole(fit.vector, 1, like=fit, nearer=NEARER[turn % len(NEARER)])
            far = fit.loss > FAR and not patient
            if fit.loss < CLEAR or (not turn and far and fit.loss > LOST * begun.loss):
                break
            if turn:
                idle = 0 if _sheds(before, fit, HOPE if far else ENOUGH) else idle + 1
            if idle == len(NEARER):
                break
        return fit


def _sheds(before: Fit, after: Fit, share: float) -> bool:
    """Whether a fit of the same casts lost more than such a share of its loss."""
    unit = miss_unit(before.residual, LEAST_UNIT)
    losses = [trial_losses(fit.residual, unit).mean() for fit in (before, after)]
    return losses[1] < losses[0] * (1 - share)


class _Fits:
    """Fits to some of a problem's casts, evenly spaced."""

    def __init__(self, problem: Problem, residuals: Residuals, casts: int) -> None:
        self.residuals = residuals
        self.trials = spread(np.arange(problem.casts), casts)
        self._steps = difference_steps(problem.parameters)
        self._prior = Prior(problem.start, np.full(len(problem.start), WIDE))

    def __call__(
        self, start: np.ndarray, iterations: int, *, like: Fit | None = None, nearer: float = 1.0
    ) -> Fit:
        return fit_robustly(
            self.residuals,
            start,
            self._steps,
            self.trials,
            iterations=iterations,
            like=like,
            prior=self._prior,
            stepping=Stepping(LEAST_UNIT, nearer, MOST),
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
