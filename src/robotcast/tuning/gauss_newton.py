"""Gauss–Newton least squares on finite differences, from a start that an ensemble finds.

Steps and differences: Nocedal and Wright 2006, ch. 10; the start: Iglesias, Law and Stuart 2013.
"""

from dataclasses import dataclass

import numpy as np

from robotcast.fitting.least_squares import (
    ENOUGH,
    Fit,
    Prior,
    Stepping,
    difference_steps,
    fit_robustly,
    miss_unit,
    trial_losses,
)
from robotcast.fitting.starts import ensemble_start, hypercube, spread
from robotcast.tuning.search import Objective, Problem, Query, Response, residuals_at

FAR = 1.15  # ½ ln(1 + 3²), the loss of casts missed by three noises: perhaps in a wrong valley
HOPE = 0.1  # of its loss that a fit so far off must shed; in a wrong valley it creeps
LOST = 3.0  # times the loss of the beginnings, on whole casts, in a wrong valley
CLEAR = 1e-5  # loss of casts missed by 0.004 noises: nothing is left to tell parameters by
ENSEMBLE_PAYS = 0.4  # of a small budget, at most: its centre is worth little without the fits
FINISH = 4  # Jacobians of a last fit that is worth having
STEPS = 9  # vectors that a Jacobian takes beside one for each parameter, itself and tried steps
WIDE = 10.0  # ranges: an expectation so wide only keeps what the casts do not tell where it is
ALL_OVER = 0.96  # of every range: where the starts may lie
# Casts that the model itself makes up have no noise; their misses lead along narrow curved valleys.
LEAST_UNIT = 0.01  # noises by which casts are judged there, at least
NEARER = (1.0, 0.25, 4.0)  # median misses; each Jacobian looks by the next of these lengths
MOST = 6  # steps for one Jacobian


@dataclass(frozen=True)
class GaussNewton:
    """Fits every waypoint at once; a Jacobian or all tried steps are one query each.

    An ensemble looks for a start on the beginnings of a few casts; a fit to those of some more
    goes on with all casts until a step hardly pays. A search that stays far above the noise begins
    again with another ensemble while the budget pays for it, at last from the best beginnings.
    """

    members: int  # of the ensemble, at most: a small budget makes do with fewer
    updates: int
    few: int  # casts that the ensemble sees
    some: int  # casts that the first fit sees
    share: float  # of each of these casts' waypoints
    early_iterations: int  # of the first fit
    iterations: int  # of the last fit, at most
    attempts: int  # searches at most, the first included
    seed: int = 0

    def minimise(self, problem: Problem, objective: Objective, budget_casts: int) -> None:
        """Search from the problem's start and from others all over the ranges."""
        _Fitting(self, problem, objective, budget_casts).run()


class _Fitting:
    """A search under way, which knows what its budget still pays for."""

    def __init__(
        self, settings: GaussNewton, problem: Problem, objective: Objective, budget_casts: int
    ) -> None:
        self._settings, self._problem, self._objective = settings, problem, objective
        self._budget_casts, self._spent_casts = budget_casts, 0
        self._early = _Fits(problem, self._paid, settings.some, settings.share)
        self._whole = _Fits(problem, self._paid, problem.casts, share=1.0)

    def run(self) -> None:
        """Begin, again where that led to a wrong valley, and finish."""
        self._paid(Query(self._problem.start[None]))
        far: list[Fit] = []
        for attempt in range(self._settings.attempts):
            before_casts = self._spent_casts
            begun = self._begun(self._settings.seed + attempt)
            paid_casts = self._spent_casts - before_casts
            last = attempt == self._settings.attempts - 1 or paid_casts > self._spare_casts()
            if begun.loss > FAR:
                far.append(begun)
                if not last:
                    continue
                begun = min(far, key=lambda fit: fit.loss)
            if self._finished(begun, patient=last).loss < FAR or last:
                return

    def _paid(self, query: Query) -> Response:
        self._spent_casts += query.cost(self._problem.casts)
        return self._objective(query)

    def _spare_casts(self) -> int:
        """Return what is left for beginnings, once the last fit has what it needs."""
        wanted = FINISH * self._whole.step_casts
        return max(self._budget_casts - self._spent_casts - wanted, 0)

    def _begun(self, seed: int) -> Fit:
        """Return a fit to the beginnings of some casts, from where an ensemble centres."""
        settings, start, early = self._settings, self._problem.start, self._early
        few = spread(early.trials, settings.few)
        paid = int(ENSEMBLE_PAYS * self._budget_casts / (settings.updates * len(few)))
        crowd = min(settings.members, max(paid, len(start) + 2))
        members = hypercube(np.full(len(start), 0.5), ALL_OVER, crowd, seed)
        members[0] = start
        centre = ensemble_start(early.residuals, members, few, settings.updates, seed)
        affordable = self._spare_casts() // early.step_casts
        return early(centre, min(settings.early_iterations, affordable))

    def _finished(self, begun: Fit, *, patient: bool) -> Fit:
        """Return where a fit to whole casts ends; unless `patient`, one without hope ends early."""
        fit, idle = begun, 0
        for turn in range(self._settings.iterations):
            nearer = NEARER[turn % len(NEARER)]
            before, fit = fit, self._whole(fit.vector, 1, like=fit, nearer=nearer)
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
    """Fits to some of a problem's casts, evenly spaced, or to the beginnings of these."""

    def __init__(self, problem: Problem, objective: Objective, casts: int, share: float) -> None:
        self.trials = spread(np.arange(problem.casts), casts)
        # what a Jacobian and the steps tried by it take, about
        self.step_casts = len(self.trials) * (len(problem.start) + STEPS)
        self._problem, self._objective, self._share = problem, objective, share
        self._prior = Prior(problem.start, np.full(len(problem.start), WIDE))

    def __call__(
        self, start: np.ndarray, iterations: int, *, like: Fit | None = None, nearer: float = 1.0
    ) -> Fit:
        return fit_robustly(
            self.residuals,
            start,
            difference_steps(self._problem.parameters),
            self.trials,
            iterations=iterations,
            like=like,
            prior=self._prior,
            stepping=Stepping(LEAST_UNIT, nearer, MOST),
        )

    def residuals(self, vectors: np.ndarray, trials: np.ndarray) -> np.ndarray:
        """Return the residuals (n_vectors, n_trials, D) in units of the noise."""
        whole = self._share == 1.0 and len(trials) == self._problem.casts
        query = Query(vectors, None if whole else tuple(trials.tolist()), self._share)
        return residuals_at(self._objective, query) / self._problem.noise_percent
