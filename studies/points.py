"""One policy of a study, and its numbers as the studies' tables show them."""

from dataclasses import dataclass

import numpy as np

from robotcast.reporting.results import Evaluation

HEAD = ("median", "from", "to", "q1", "q3", "scatter", "casts")


@dataclass(frozen=True)
class Point:
    """One policy of a study.

    Attributes
    ----------
    group : what the policy is compared by, such as its dataset.
    place : where it stands, a number of casts or the rung of a ladder.
    """

    group: str
    place: float
    evaluation: Evaluation

    @property
    def numbers(self) -> tuple[float, ...]:
        """Return `HEAD`: median, its 95 % interval, quartiles and scatter of repeats, and casts.

        All but the casts are in % of cable length.
        """
        errors = self.evaluation.errors_percent
        low, high = self.evaluation.median_interval or (np.nan, np.nan)
        middle, q1, q3 = np.percentile(errors, [50, 25, 75])
        scatter = self.evaluation.scatter_percent
        apart = np.nan if scatter is None else scatter
        return (*(float(v) for v in (middle, low, high, q1, q3, apart)), len(errors))
