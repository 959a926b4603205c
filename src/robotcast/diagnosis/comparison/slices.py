"""Slices of the measured samples, and how large the error is inside them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robotcast.diagnosis.comparison.misfit import Misfit, misfit
from robotcast.diagnosis.model import Record


@dataclass(frozen=True)
class Slice:
    """Some samples of some trials, and a way to look at their errors.

    Attributes
    ----------
    name : what it is in a few words, "in the coast".
    kind : "phase", "place", "speed", "heading", "trial" or the name of a factor; slices of one
        kind say the same thing in different ways.
    subject : how a sentence on it begins, "Casts with alpha above 1.6 rad".
    trials : the number of the trial in every row.
    mask : bool ndarray of shape (n_trials, k_max).
    directions : unit vectors (n_trials, k_max, d) along which errors are taken; None for their
        whole length.
    whole_trials : it takes a trial with all its samples or not at all.
    """

    name: str
    kind: str
    subject: str
    trials: tuple[int, ...]
    mask: np.ndarray
    directions: np.ndarray | None = None
    whole_trials: bool = False

    def signed(self, found: Misfit) -> np.ndarray:
        """Return every sample's error along the directions, else its length, (n_trials, k_max)."""
        if self.directions is None:
            return found.distance
        along = (found.error * self.directions).sum(axis=-1)
        # a diverged run misses by one scale, as far along as across
        return np.where(found.diverged[:, None], found.distance / np.sqrt(2), along)

    def sizes(self, found: Misfit) -> np.ndarray:
        """Return the size of every sample's error as the slice looks at it, (n_trials, k_max)."""
        return np.abs(self.signed(found))

    def rows(self, records: Sequence[Record]) -> "Slice":
        """Return the slice of these records only, in their order."""
        row_of = {trial: row for row, trial in enumerate(self.trials)}
        unknown = [r.trial for r in records if r.trial not in row_of]
        if unknown:
            raise ValueError(f"slice {self.name!r} was not made of trial {unknown[0]}")
        rows = [row_of[r.trial] for r in records]
        k_max = max(len(r.times_s) for r in records)
        return replace(
            self,
            trials=tuple(r.trial for r in records),
            mask=self.mask[rows, :k_max],
            directions=None if self.directions is None else self.directions[rows, :k_max],
        )


def slice_errors(
    slices: Sequence[Slice], records: Sequence[Record], predicted: np.ndarray, scale: float
) -> list[float | None]:
    """Return the average error inside every slice in % of scale, to see what a change mends.

    Parameters
    ----------
    records : trials that the slices were made of, all or some, in any order.
    predicted : ndarray of shape (n_trials, k_max, d), the prediction of these records.

    Returns
    -------
    One number a slice; None for a slice that has no sample in these records.
    """
    found = misfit(records, predicted, scale)
    errors: list[float | None] = []
    for some in (s.rows(records) for s in slices):
        sizes = some.sizes(found)[some.mask & found.present]
        errors.append(float(100 / scale * sizes.mean()) if len(sizes) else None)
    return errors
