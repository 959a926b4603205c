"""By how much a perfect model would still miss, as errors are judged."""

from dataclasses import dataclass

import numpy as np

from robotcast.diagnosis.comparison.repeats import RepeatScatter

LEAST_PERCENT = 0.3  # no noise is known to be smaller
AT_THE_FLOOR = 1.1  # of the floor: with less error than this nothing is missing
ABOVE = 2.0  # of the floor: with more error than this, what is left is worth a closer look
FAR_ABOVE = 4.0  # of the floor: with more than this something is missing, whatever explains it


@dataclass(frozen=True)
class Floor:
    """The noise floor as repeats show it.

    A few whip-like actions scatter by ten times the rest, and with six repeated actions one of
    them doubles the average. Errors are therefore judged in units of what an action usually
    scatters by, and by their logarithm.

    Attributes
    ----------
    percent : average deviation of repeats, % of the scale; None when unknown.
    unit_percent : deviation of the action in the middle, % of the scale.
    miss : mean of `misses` that the repeats themselves make.
    """

    percent: float | None
    unit_percent: float
    miss: float

    @classmethod
    def of(cls, repeats: RepeatScatter) -> "Floor":
        """Take the floor from repeats; nothing is known of it when there are none."""
        deviations = np.concatenate([*repeats.deviations_percent, np.empty(0)])
        if not len(deviations):
            return cls(None, LEAST_PERCENT, 0.0)
        middle = float(np.median([own.mean() for own in repeats.deviations_percent]))
        unit = max(middle, LEAST_PERCENT)
        return cls(float(deviations.mean()), unit, float(_misses(deviations, unit).mean()))

    @classmethod
    def known(cls, percent: float) -> "Floor":
        """Take the floor from elsewhere."""
        unit = max(percent, LEAST_PERCENT)
        return cls(percent, unit, float(_misses(np.array([percent]), unit)[0]))

    def misses(self, errors: np.ndarray) -> np.ndarray:
        """Return errors [% of the scale] as a fit judges them, ½ ln(1 + (error / unit)²)."""
        return _misses(errors, self.unit_percent)

    def excess(self, errors: np.ndarray) -> float:
        """Return by how much errors (n_trials,) miss more than repeats do, at least 0."""
        return max(float(self.misses(errors).mean()) - self.miss, 0.0)

    def reached(self, errors: np.ndarray) -> bool:
        """Tell whether errors (n_trials,) are hardly larger than repeats differ."""
        return self.percent is not None and self.excess(errors / AT_THE_FLOOR) == 0.0

    def above(self, errors: np.ndarray) -> bool:
        """Tell whether errors (n_trials,) are so much larger that something may be missing."""
        return self._exceeded(ABOVE, errors)

    def far_above(self, errors: np.ndarray) -> bool:
        """Tell whether errors (n_trials,) are so much larger that something must be missing."""
        return self._exceeded(FAR_ABOVE, errors)

    def _exceeded(self, times: float, errors: np.ndarray) -> bool:
        return self.percent is not None and self.excess(errors / times) > 0.0


def _misses(errors: np.ndarray, unit: float) -> np.ndarray:
    return 0.5 * np.log1p((errors / unit) ** 2)
