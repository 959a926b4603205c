"""Ranges of one quantity between round numbers, and how they are said."""

import math
from dataclasses import dataclass

import numpy as np

QUANTILES = (0.2, 0.25, 1 / 3, 0.4, 0.5, 0.6, 2 / 3, 0.75, 0.8)
FEW_VALUES = 6  # a quantity with no more different values is split between them


@dataclass(frozen=True)
class Range:
    """A range of one quantity: above `low` and not above `high`."""

    low: float
    high: float
    decimals: int

    def holds(self, values: np.ndarray) -> np.ndarray:
        """Return where values lie inside; nowhere for NaN."""
        return (values > self.low) & (values <= self.high)

    def text(
        self, unit: str, above: str = "above", below: str = "below", between: str = "between"
    ) -> str:
        """Say the range: "above 1.6 rad", "below …", "between … and …"."""
        unit = f" {unit}" if unit not in ("", "1") else ""
        low, high = (_number(bound, self.decimals) for bound in (self.low, self.high))
        if math.isinf(self.high):
            return f"{above} {low}{unit}"
        if math.isinf(self.low):
            return f"{below} {high}{unit}"
        return f"{between} {low} and {high}{unit}"


def ranges(values: np.ndarray) -> list[Range]:
    """Return the lower and upper parts of values at round numbers, and the middle third last."""
    distinct = np.unique(values[np.isfinite(values)])
    if len(distinct) < 2:
        return []
    decimals = max(0, math.ceil(-math.log10((distinct[-1] - distinct[0]) / 40)))
    if len(distinct) <= FEW_VALUES:
        cuts = (distinct[1:] + distinct[:-1]) / 2
        low, high = cuts[[0, -1]]
    else:
        quantiles = np.round(np.nanquantile(values, QUANTILES), decimals)
        cuts = np.unique(quantiles)
        low, high = quantiles[[2, 6]]
    below = [Range(-math.inf, float(cut), decimals) for cut in cuts]
    above = [Range(float(cut), math.inf, decimals) for cut in cuts]
    return [*below, *above, Range(float(low), float(high), decimals)]


def thirds(values: np.ndarray) -> list[Range]:
    """Return the lower, middle and upper third of values at round numbers."""
    found = ranges(values)
    if not found:
        return []
    middle = found[-1]
    return [
        Range(-math.inf, middle.low, middle.decimals),
        middle,
        Range(middle.high, math.inf, middle.decimals),
    ]


def _number(value: float, decimals: int) -> str:
    return f"{value:.{decimals}f}".replace("-", "−")
