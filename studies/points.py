"""One policy of a study, and its numbers as the studies' tables show them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robotcast.reporting.results import Evaluation

_DRAWS, _SEED = 4000, 0
HEAD = ("median", "from", "to", "q1", "q3", "scatter", "casts")


@dataclass(frozen=True)
class Point:
    """One policy of a study."""

    group: str  # what it is compared by, such as its dataset
    place: float  # where it stands, a number of casts or the rung of a ladder
    evaluation: Evaluation

    @property
    def numbers(self) -> tuple[float, ...]:
        """Return `HEAD`: median, its 95 % interval, quartiles, scatter of repeats [% of cable
        length], and casts."""
        errors, scatter = self.evaluation.errors_percent, self.evaluation.scatter_percent
        low, high = self.evaluation.median_interval or (np.nan, np.nan)
        middle, q1, q3 = np.percentile(errors, [50, 25, 75])
        apart = np.nan if scatter is None else scatter
        return (*(float(v) for v in (middle, low, high, q1, q3, apart)), len(errors))


def change(before: Evaluation, after: Evaluation) -> tuple[float, float, float]:
    """Return by how much of itself the median error changed, and the 95 % interval of that.

    Only targets count at which casts of both policies were tracked; ValueError without any.
    """
    first, last = before.errors_by_target, after.errors_by_target
    both = [target for target in first if target in last]
    if not both:
        raise ValueError("the two policies have no target at which casts of both were tracked")
    return median_change([first[k] for k in both], [last[k] for k in both])


def median_change(
    before: Sequence[np.ndarray], after: Sequence[np.ndarray]
) -> tuple[float, float, float]:
    """Return by what share the median of all errors changed, and the 95 % interval of that.

    The interval is a bootstrap over targets (Efron 1979), the same ones drawn before and after:
    what makes a target hard makes it so for both, and cancels. Errors are of shape (repeats,), one
    a target, in the same order; none is empty.
    """
    random, n = np.random.default_rng(_SEED), len(before)
    drawn = (random.integers(n, size=n) for _ in range(_DRAWS))
    changes = [_median(after, targets) / _median(before, targets) - 1 for targets in drawn]
    low, high = np.percentile(changes, [2.5, 97.5])
    return _median(after, range(n)) / _median(before, range(n)) - 1, float(low), float(high)


def _median(errors: Sequence[np.ndarray], targets: Sequence[int] | np.ndarray) -> float:
    return float(np.median(np.concatenate([errors[k] for k in targets])))
