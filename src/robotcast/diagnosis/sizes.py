"""How large the parameters of a fitted revision are, with intervals."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robotcast.diagnosis.inquiry import Inquiry, Revision
from robotcast.fitting.least_squares import Fit, bread, median_miss, sandwich
from robotcast.fitting.parameter import Parameter

SPREAD = 2.0  # standard errors on either side of a value


@dataclass(frozen=True)
class Size:
    """A parameter's value with an interval of two standard errors on either side."""

    parameter: Parameter
    value: float
    low: float
    high: float

    def as_dict(self) -> dict[str, float | str | None]:
        """Return the size as `diagnosis.json` has it."""
        return {
            "value": self.value,
            "low": self.low,
            "high": self.high,
            "unit": self.parameter.unit,
            "null": self.parameter.null,
        }


def sizes(
    inquiry: Inquiry,
    revision: Revision,
    vectors: np.ndarray | None,
    discrepancy: float,
) -> tuple[Size, ...]:
    """Return the size of every parameter, in a vector's order.

    The standard error is the larger of two: the sandwich estimator with groups of trials as
    clusters (Liang and Zeger 1986), and the jackknife over the folds' fits `vectors` (k, n).
    Both shrink as trials are added, but what a model misses everywhere in the same way does not
    (Kennedy and O'Hagan 2001): the most by which a misfit in every trial of this share,
    `discrepancy`, of what the model misses in a usual one can shift the value is added in
    squares. It misses the noise at least. So is how much it leans on what was expected before any
    trial, as if that were one more, of its own variance: what no trial tells may be anything that
    was expected. What is held has no width. On either side comes what the model's own step shifts
    the value by.
    """
    sd = inquiry.expected(revision.effects)
    inverse = bread(revision.fit, sd)
    error = sandwich(revision.fit, inverse, inquiry.groups)
    if vectors is not None and len(vectors) > 1:
        k = len(vectors)
        error = np.maximum(error, np.sqrt((k - 1) / k * ((vectors - vectors.mean(0)) ** 2).sum(0)))
    leans = np.sqrt(((inverse / sd) ** 2).sum(axis=1))
    error = np.hypot(error, leans * inquiry.free(revision.effects))
    error = np.hypot(error, _shift(revision.fit, inverse, discrepancy) / SPREAD)
    reach = SPREAD * error + np.abs(inquiry.step_shift(revision.effects, revision.fit, inverse))
    centre = revision.fit.vector
    found = []
    for k, parameter in enumerate(inquiry.parameters(revision.effects)):
        ends = np.clip(centre[k] + reach[k] * np.array([0.0, -1.0, 1.0]), 0.0, 1.0)
        value, low, high = parameter.from_unit(ends).tolist()
        found.append(Size(parameter, value, low, high))
    return tuple(found)


def may_be(law: Sequence[Size], case: Sequence[Parameter]) -> bool:
    """Tell whether the intervals of all that a law has beyond its special case hold their nulls."""
    more = [one for one in law if one.parameter.name not in {p.name for p in case}]
    return all(
        one.low <= p.null <= one.high for one in more if (p := one.parameter).null is not None
    )


def _shift(fit: Fit, inverse: np.ndarray, discrepancy: float) -> np.ndarray:
    """Return by how much (n,) the worst misfit of such a share in every trial shifts a value."""
    by_trial = np.einsum("nm,idm,i->ind", inverse, fit.jacobian, fit.weights)
    missed = max(1.0, median_miss(fit.residual))
    return discrepancy * missed * np.sqrt((by_trial**2).sum(axis=-1)).sum(axis=0)
