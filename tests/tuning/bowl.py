"""A problem whose answer is known, without any simulator."""

from dataclasses import dataclass

import numpy as np

from robotcast.fitting.parameter import Parameter
from robotcast.tuning.search import Problem, Query, Response

TRUE = np.array([0.3, 0.7, 0.5])
CASTS = 6
PARAMETERS = tuple(Parameter(name, "1", 0.0, 1.0, 0.5) for name in "abc")
PROBLEM = Problem(PARAMETERS, np.full(3, 0.5), CASTS, noise_percent=0.3)


@dataclass
class Bowl:
    """Every cast misses by a gently curved function of the distance from `TRUE`, in %.

    Attributes
    ----------
    dies_at : the query at which the process is killed.
    cliff : vectors whose first number is above it make every run diverge.
    """

    dies_at: int = -1
    cliff: float = np.inf
    asked: int = 0

    def __call__(self, query: Query) -> Response:
        if self.asked == self.dies_at:
            raise KeyboardInterrupt
        self.asked += 1
        casts = np.arange(CASTS) if query.casts is None else np.array(query.casts)
        away = query.vectors - TRUE
        slopes = 10 * np.random.default_rng(1).normal(size=(CASTS, 4, 3))[casts]
        residuals = np.einsum("cdn,vn->vcd", slopes, away + 0.3 * away**2)
        lost = query.vectors[:, 0] > self.cliff
        residuals[lost] = [100.0, 0.0, 0.0, 0.0]
        percent = np.sqrt((residuals**2).sum(axis=-1)).mean(axis=-1)
        shown = residuals if query.with_residuals else None
        return Response(percent, np.where(lost, len(casts), 0), shown)
