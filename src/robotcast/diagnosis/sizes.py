"""How large the parameters of a fitted revision are, with intervals."""

from dataclasses import dataclass

import numpy as np

from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.revision import Revision
from robotcast.fitting.least_squares import PRIOR_SD
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


def sizes(inquiry: Inquiry, revision: Revision, vectors: np.ndarray | None) -> tuple[Size, ...]:
    """Return the size of every parameter, in a vector's order.

    The standard error is the larger of two: the sandwich estimator with groups of trials as
    clusters (Liang and Zeger 1986), and the jackknife over the folds' fits `vectors` (k, n).
    """
    error = _sandwich(inquiry, revision)
    if vectors is not None and len(vectors) > 1:
        k = len(vectors)
        error = np.maximum(error, np.sqrt((k - 1) / k * ((vectors - vectors.mean(0)) ** 2).sum(0)))
    centre = revision.fit.vector
    found = []
    for k, parameter in enumerate(inquiry.parameters(revision.effects)):
        ends = np.clip(centre[k] + SPREAD * error[k] * np.array([0.0, -1.0, 1.0]), 0.0, 1.0)
        value, low, high = parameter.from_unit(ends).tolist()
        found.append(Size(parameter, value, low, high))
    return tuple(found)


def _sandwich(inquiry: Inquiry, revision: Revision) -> np.ndarray:
    fit, groups = revision.fit, inquiry.groups
    weighted = fit.jacobian * fit.weights[:, None, None]
    bread = np.einsum("idn,idm->nm", weighted, fit.jacobian)
    bread += np.eye(len(fit.vector)) / PRIOR_SD**2
    scores = np.einsum("idn,id->in", weighted, fit.residual)
    by_group = np.zeros((groups.max() + 1, scores.shape[1]))
    np.add.at(by_group, groups, scores)
    inverse = np.linalg.inv(bread)
    n, p = by_group.shape
    meat = by_group.T @ by_group * n / max(n - p, 1)
    return np.sqrt(np.diag(inverse @ meat @ inverse))
