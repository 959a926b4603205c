"""How much the errors of one policy are below those of another one at the same targets."""

from collections.abc import Sequence

import numpy as np

_DRAWS, _SEED = 4000, 0


def median_change(
    before: Sequence[np.ndarray], after: Sequence[np.ndarray]
) -> tuple[float, float, float]:
    """Return by what share the median of all errors changed, and the 95 % interval of that.

    The interval is a bootstrap over targets (Efron 1979), the same ones drawn before and after:
    what makes a target hard makes it so for both, and cancels.

    Parameters
    ----------
    before, after : ndarrays of shape (repeats,), one a target, in the same order; none is empty.
    """
    random = np.random.default_rng(_SEED)
    n = len(before)
    drawn = (random.integers(n, size=n) for _ in range(_DRAWS))
    changes = [_median(after, targets) / _median(before, targets) - 1 for targets in drawn]
    low, high = np.percentile(changes, [2.5, 97.5])
    return _median(after, range(n)) / _median(before, range(n)) - 1, float(low), float(high)


def _median(errors: Sequence[np.ndarray], targets: Sequence[int] | np.ndarray) -> float:
    return float(np.median(np.concatenate([errors[k] for k in targets])))
