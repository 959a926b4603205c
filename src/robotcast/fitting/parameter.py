"""A number of a model that fitting may change."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np


@dataclass(frozen=True)
class Parameter:
    """One parameter of a model with what fitting needs to know of it."""

    name: str
    unit: str
    lower: float
    upper: float
    nominal: float
    scale: Literal["linear", "log"] = "linear"  # "log" is searched by its logarithm
    frozen: bool = False  # held at its nominal value
    null: float | None = None  # of an effect's strength, where the effect does nothing
    # of an effect's parameter, values at which a first look simulates it: sizes that would matter
    # of a strength, places to try of the others
    probes: tuple[float, ...] = ()
    prior_sd: float = 1.0  # of the range, expected before any measurement, of a strength about null

    def __post_init__(self) -> None:
        if not self.lower <= self.nominal <= self.upper or self.lower >= self.upper:
            raise ValueError(
                f"parameter {self.name}: expected lower ≤ nominal ≤ upper and lower < upper, "
                f"got {self.lower}, {self.nominal}, {self.upper}"
            )
        if self.scale == "log" and self.lower <= 0:
            raise ValueError(f"parameter {self.name}: a log scale needs lower > 0")

    def to_unit(self, value: np.ndarray) -> np.ndarray:
        """Map values in bounds to [0, 1] on the parameter's scale."""
        if self.scale == "log":
            return np.log(value / self.lower) / math.log(self.upper / self.lower)
        return (value - self.lower) / (self.upper - self.lower)

    def from_unit(self, unit: np.ndarray) -> np.ndarray:
        """Map [0, 1] to values in bounds, the inverse of `to_unit`."""
        if self.scale == "log":
            return self.lower * np.exp(unit * math.log(self.upper / self.lower))
        return self.lower + unit * (self.upper - self.lower)
