"""Shift and scale that bring a column to mean 0 and spread 1."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Normalisation:
    """Computed on a training set once, then part of the model.

    Attributes
    ----------
    mean, scale : ndarray of shape (d,), in the units of the columns.
    """

    mean: np.ndarray
    scale: np.ndarray

    @classmethod
    def of(cls, values: np.ndarray) -> "Normalisation":
        """Compute from values (n, d); a column that never changes keeps scale 1."""
        spread = values.std(axis=0)
        return cls(values.mean(axis=0), np.where(spread > 1e-9, spread, 1.0))

    def apply(self, values: np.ndarray) -> np.ndarray:
        """Normalise values (n, d)."""
        return (values - self.mean) / self.scale

    def undo(self, normalised: np.ndarray) -> np.ndarray:
        """Return values (n, d) from normalised ones."""
        return normalised * self.scale + self.mean

    def as_dict(self) -> dict[str, list[float]]:
        """Return plain numbers for a YAML file."""
        return {"mean": self.mean.tolist(), "scale": self.scale.tolist()}

    @classmethod
    def from_dict(cls, numbers: dict[str, list[float]]) -> "Normalisation":
        """Read back `as_dict`."""
        return cls(np.array(numbers["mean"]), np.array(numbers["scale"]))
