"""How well the tuning casts tell what was tuned: intervals and conditioning at the optimum."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from robotcast.fitting import least_squares
from robotcast.tuning.search import Objective, Problem, Query, residuals_at

STANDARD_ERRORS = 2.0  # on either side of a value
VAGUE = 0.5  # of a parameter's range: an interval wider than that says little
MOST = 1e6  # a larger condition number tells no more
TAKES_PART = 0.3  # share of a direction from which on a parameter belongs to it


@dataclass(frozen=True)
class Certainty:
    """What a Jacobian at the optimum says of the tuned parameters.

    Its condition number over the ranges, at most `MOST`, is by how much better the casts tell the
    best-known direction than the worst. Several parameters of the worst direction are told only in
    combination.
    """

    intervals: Mapping[str, tuple[float, float]]  # two standard errors to a side, inside the bounds
    vague: tuple[str, ...]  # names whose interval covers more than half of their range
    condition: float
    least_known: tuple[str, ...]  # the parameters of the worst direction
    simulated_casts: int


def certainty_casts(problem: Problem) -> int:
    """Return how many casts `certainty` simulates."""
    return 2 * (2 * len(problem.parameters) + 1) * problem.casts


def certainty(
    objective: Objective, problem: Problem, vector: np.ndarray, groups: np.ndarray
) -> Certainty:
    """Differentiate every waypoint at a unit vector (n_free,), in two queries.

    The first takes a step in each parameter; the second one along each axis of the curvature that
    the first showed, as long as moves the casts by about the noise. A standard error is the larger
    of two: the sandwich estimator with `groups` as clusters, the actions of the casts (n_casts,)
    numbered from 0, which sees what the model misses, and the one that takes each cast for one
    measurement, which does not trust a few that agree.
    """
    coarse = _about(vector, np.diag(least_squares.difference_steps(problem.parameters)))
    residuals = residuals_at(objective, Query(coarse)) / problem.noise_percent
    fit = least_squares.Fit(vector, residuals[0], least_squares.slopes(coarse, residuals))
    fine = _about(vector, least_squares.noise_axes(fit, np.ones(len(vector), dtype=bool)))
    residuals = residuals_at(objective, Query(fine)) / problem.noise_percent
    fit = least_squares.Fit(vector, residuals[0], least_squares.steady_slopes(fine, residuals))
    inverse = least_squares.bread(fit, np.array([p.prior_sd for p in problem.parameters]))
    error = np.maximum(least_squares.sandwich(fit, inverse, groups), np.sqrt(np.diag(inverse)))
    ends = np.clip(vector + STANDARD_ERRORS * error * np.array([[-1.0], [1.0]]), 0.0, 1.0)
    values, axes = np.linalg.eigh(least_squares.curvature(fit))
    least, most = max(float(values[0]), 0.0), float(values[-1])
    names = np.array([p.name for p in problem.parameters])
    return Certainty(
        intervals={
            p.name: (float(p.from_unit(low)), float(p.from_unit(high)))
            for p, low, high in zip(problem.parameters, *ends, strict=True)
        },
        vague=tuple(names[2 * STANDARD_ERRORS * error > VAGUE].tolist()),
        condition=float(np.sqrt(most / least)) if least * MOST**2 > most else MOST,
        least_known=tuple(names[axes[:, 0] ** 2 > TAKES_PART**2].tolist()),
        simulated_casts=(len(coarse) + len(fine)) * problem.casts,
    )


def _about(vector: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Return the vector and those a step (n_steps, n) to either side of it, inside the bounds."""
    return np.clip(np.vstack([vector, vector + steps, vector - steps]), 0.0, 1.0)
