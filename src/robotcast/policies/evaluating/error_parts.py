"""What a policy's errors are made of, and how sure their median is."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_DRAWS = 2000
_SEED = 0


@dataclass(frozen=True)
class ErrorParts:
    """Root mean squares of the parts of a policy's errors, in the unit of the endpoints.

    Attributes
    ----------
    repeatability : how far repeats of one action scatter about their mean (aleatoric): no model
        can lower it.
    model : how far the mean of the repeats lies from the target (epistemic).
    """

    repeatability: float
    model: float

    @property
    def repeatability_share(self) -> float:
        """The part of the mean square error that is repeatability, from 0 to 1."""
        total = self.repeatability**2 + self.model**2
        return self.repeatability**2 / total if total > 0 else 0.0


def error_parts(ends: Sequence[np.ndarray], targets: Sequence[np.ndarray]) -> ErrorParts | None:
    """Split the mean square error at targets that were cast at more than once; None without any.

    The scatter of the mean itself is taken off the model's part, so that few repeats do not
    count as a worse model.

    Parameters
    ----------
    ends : ndarrays of shape (repeats, 2), one a target; `targets` : of shape (2,).
    """
    scattered, missed = [], []
    for points, target in zip(ends, targets, strict=True):
        if len(points) < 2:
            continue
        centre = points.mean(axis=0)
        variance = np.square(points - centre).sum() / (len(points) - 1)
        scattered.append(variance)
        missed.append(np.square(centre - target).sum() - variance / len(points))
    if not scattered:
        return None
    return ErrorParts(float(np.sqrt(np.mean(scattered))), float(np.sqrt(max(np.mean(missed), 0.0))))


def median_interval(errors: Sequence[np.ndarray], level: float = 0.95) -> tuple[float, float]:
    """Return the bootstrap interval of the median of all errors (Efron 1979).

    Whole targets are drawn, with all their repeats: casts at one target fail together.

    Parameters
    ----------
    errors : ndarrays of shape (repeats,), one a target.
    """
    random = np.random.default_rng(_SEED)
    filled = [e for e in errors if len(e)]
    medians = [
        np.median(
            np.concatenate([filled[k] for k in random.integers(len(filled), size=len(filled))])
        )
        for _ in range(_DRAWS)
    ]
    low, high = np.percentile(medians, [50 * (1 - level), 50 * (1 + level)])
    return float(low), float(high)
