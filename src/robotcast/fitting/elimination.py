"""A fit from many starts, by elimination: on beginnings of some trials, then on all.

What a chaotic model does late in a trial has a valley for every way in which it tips over; the
beginnings lead smoothly to the right one.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.stats import qmc

from robotcast.fitting.least_squares import Fit, Residuals, trial_losses


class FitFrom(Protocol):
    """Fits a model to some trials."""

    def __call__(self, start: np.ndarray, iterations: int, *, known: Fit | None = None) -> Fit:
        """Fit from a unit vector (n,), or go on from a `known` fit that ended there."""
        ...


@dataclass(frozen=True)
class Rounds:
    """How many fits take part in each round, and how many iterations each takes there.

    Attributes
    ----------
    begun, left : fits to the beginnings that start, and those of them that go on.
    ended : fits to whole trials; the best of them goes on to the end.
    """

    begun: int = 6
    begun_iterations: int = 3
    left: int = 3
    left_iterations: int = 5
    ended: int = 2
    ended_iterations: int = 4


def fit_by_elimination(
    early: FitFrom, whole: FitFrom, starts: np.ndarray, iterations: int, rounds: Rounds
) -> Fit:
    """Return the fit that outlives the others.

    Parameters
    ----------
    early, whole : fit to the beginnings of some trials, and to all trials.
    starts : ndarray of shape (n_starts, n), unit vectors, best first.
    iterations : of the last fit.
    """
    begun = [early(start, rounds.begun_iterations) for start in starts[: rounds.begun]]
    begun.sort(key=lambda fit: fit.loss)
    left = [early(f.vector, rounds.left_iterations, known=f) for f in begun[: rounds.left]]
    left.sort(key=lambda fit: fit.loss)
    ended = [whole(fit.vector, rounds.ended_iterations) for fit in left[: rounds.ended]]
    best = min(ended, key=lambda fit: fit.loss)
    return whole(best.vector, iterations, known=best)


def best_first(residuals: Residuals, trials: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Return unit vectors (n_vectors, n) ordered by their loss on some trials."""
    losses = trial_losses(residuals(vectors, trials)).mean(axis=1)
    return vectors[np.argsort(losses, kind="stable")]


def hypercube(centre: np.ndarray, width: float, n: int, seed: int) -> np.ndarray:
    """Return a Latin hypercube (n, n_parameters) about a unit vector, clear of the bounds."""
    cube = qmc.LatinHypercube(len(centre), rng=np.random.default_rng(seed)).random(n)
    return np.clip(centre + width * (cube - 0.5), 0.02, 0.98)


def spread(trials: np.ndarray, n: int) -> np.ndarray:
    """Return about n of the trials, evenly spaced."""
    return trials[:: max(1, len(trials) // n)]
