"""Whether a slice holds more of the squared error than chance gives it."""

from collections.abc import Sequence

import numpy as np

from robotcast.diagnosis.comparison.misfit import Misfit
from robotcast.diagnosis.comparison.slices import Slice

PERMUTATIONS = 2000


class Contrast:
    """The squared error inside slices against what their share of the samples would hold.

    The weight of a slice is the sum over samples of (m − f) s: m is 1 inside and 0 outside, f
    the slice's share of the samples, s the squared error. It is the sum of two parts over
    trials: how inside and outside differ within each trial, and how the trial's mean goes with
    the part of the trial that lies inside. When the error does not depend on the slice, the
    first may as well have the other sign in any trial, and the second may as well belong to any
    other trial. So whole trials are permuted, however the errors inside a trial hang together.
    For a slice with directions, the weight is the squared error along them less an equal part
    of the whole, and only its signs are permuted.

    Parameters
    ----------
    used : bool ndarray of shape (n_trials, k_max), the samples that take part.
    """

    def __init__(
        self, slices: Sequence[Slice], found: Misfit, used: np.ndarray, rng: np.random.Generator
    ) -> None:
        self._slices, self._found = slices, found
        self._rows = np.flatnonzero(used.any(axis=1))
        self._used = used[self._rows]
        self._masks = [some.mask[self._rows] & self._used for some in slices]
        self._size = self._used.sum(axis=1)
        self._part = np.array([mask.sum(axis=1) for mask in self._masks]) / self._size
        n = len(self._rows)
        self._signs = rng.choice([-1.0, 1.0], size=(PERMUTATIONS, n))
        self._orders = rng.permuted(np.tile(np.arange(n), (PERMUTATIONS, 1)), axis=1)

    def test(self, square: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return every slice's weight and p-value, each (n_slices,).

        The p-value is the chance that any slice would stand out as much, every weight taken in
        its own standard deviations.

        Parameters
        ----------
        square : ndarray of shape (n_trials, k_max), squared errors.
        """
        mean = np.where(self._used, square[self._rows], 0).sum(axis=1) / self._size
        within, lean = self._within(square, mean), self._lean()
        weight = within.sum(axis=1) + lean @ mean
        drawn = self._signs @ within.T + mean[self._orders] @ lean.T
        spread = np.maximum(drawn.std(axis=0), 1e-12 * (mean @ self._size))
        largest = (drawn / spread).max(axis=1)
        as_large = (largest[:, None] >= weight / spread).sum(axis=0)
        return weight, (1 + as_large) / (1 + PERMUTATIONS)

    def shares(self, at: int, square: np.ndarray) -> tuple[float, float]:
        """Return slice `at`'s share of `square` and of the samples.

        For a slice with directions, the share of the squared error that lies along them, and
        an equal part for every direction.
        """
        inside, own = self._masks[at], square[self._rows]
        if self._slices[at].directions is not None:
            along = self._slices[at].sizes(self._found)[self._rows] ** 2
            return float(along[inside].sum() / own[inside].sum()), 1 / self._found.error.shape[-1]
        return (
            float(own[inside].sum() / own[self._used].sum()),
            float(inside.sum() / self._used.sum()),
        )

    def without(self, at: int, square: np.ndarray) -> np.ndarray:
        """Return `square` with slice `at` brought to the level of the other samples."""
        if self._slices[at].directions is not None:
            return square
        own, inside = square[self._rows], self._masks[at]
        surplus = own[inside].mean() - own[self._used & ~inside].mean()
        level = square.copy()
        level[self._rows] -= np.where(inside, surplus, 0)
        return level

    def _within(self, square: np.ndarray, mean: np.ndarray) -> np.ndarray:
        """Return how much more every slice holds of each trial than its part, (n_slices, n)."""
        own = square[self._rows]
        # along a direction it is the error itself: levels taken out of `square` have none
        whole = self._found.distance[self._rows] ** 2 / self._found.error.shape[-1]
        within = []
        for some, mask, part in zip(self._slices, self._masks, self._part, strict=True):
            if some.directions is None:
                held = np.where(mask, own, 0).sum(axis=1)
                within.append(held - part * self._size * mean)
            else:
                along = some.sizes(self._found)[self._rows] ** 2
                within.append(np.where(mask, along - whole, 0).sum(axis=1))
        return np.array(within)

    def _lean(self) -> np.ndarray:
        """Return how many more samples than its share every slice has of each trial."""
        share = (self._part * self._size).sum(axis=1) / self._size.sum()
        lean = (self._part - share[:, None]) * self._size
        directed = [s.directions is not None for s in self._slices]
        lean[directed] = 0
        return lean
