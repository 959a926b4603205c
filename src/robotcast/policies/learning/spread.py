"""How far casts end from where a forward model says, set on casts held out from its training."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from robotcast.policies.learning.datasets import Examples

_WITHIN = 0.6827  # part of a normal distribution within one standard deviation
_PARTS = np.linspace(0.0, 1.0, 21)[1:-1]  # of the slope, that are tried


@dataclass(frozen=True)
class Spread:
    """Standard deviations √((of_doubt d)² + (of_slope |S|)²) of an endpoint, times `scale`.

    A model doubts where its examples scattered or were few. And wherever the endpoint moves far
    with the action, chance in the arm, the cable and the board moves it far too: how far a cast
    ends from its prediction follows the slope more than a network's doubt, above all where the
    network learned from few casts, which it hardly misses.

    Attributes
    ----------
    unit : ndarray of shape (d,), of the numbers of an action, that S = ∂endpoint/∂action takes.
    of_doubt, of_slope : weights of both.
    scale : ndarray of shape (2,), for x and y.
    """

    unit: np.ndarray
    of_doubt: float
    of_slope: float
    scale: np.ndarray

    def __call__(self, doubt: np.ndarray, slopes: np.ndarray) -> np.ndarray:
        """Return standard deviations (n, 2) [m].

        Parameters
        ----------
        doubt : ndarray of shape (n,), the model's, up to a factor.
        slopes : ndarray of shape (n, 2, d).
        """
        slope_m = slope_size(slopes, self.unit)
        return np.hypot(self.of_doubt * doubt, self.of_slope * slope_m)[:, None] * self.scale

    def as_dict(self) -> dict[str, Any]:
        """Return plain numbers for a YAML file."""
        return {**vars(self), "unit": self.unit.tolist(), "scale": self.scale.tolist()}

    @classmethod
    def from_dict(cls, numbers: Mapping[str, Any]) -> "Spread":
        """Read back `as_dict`."""
        return cls(
            np.array(numbers["unit"]),
            numbers["of_doubt"],
            numbers["of_slope"],
            np.array(numbers["scale"]),
        )

    @classmethod
    def plain(cls, numbers: int) -> "Spread":
        """Return the spread that is the doubt itself, of actions of so many numbers."""
        return cls(np.ones(numbers), 1.0, 0.0, np.ones(2))

    @classmethod
    def of(
        cls,
        misses_m: np.ndarray,
        doubt: np.ndarray,
        slopes: np.ndarray,
        unit: np.ndarray,
        weights: np.ndarray,
    ) -> "Spread":
        """Set a spread on held-out casts.

        The part that the slope has in the variance makes the misses most likely, were their
        sizes distributed as Laplace's and all parts as likely before as in the middle of a
        parabola, so that few casts do not rule one of both out.

        Parameters
        ----------
        misses_m : ndarray of shape (n, 2), measured minus predicted endpoints.
        weights : ndarray of shape (n,).
        """
        weights = weights / weights.sum()
        slope_m, sizes_m = slope_size(slopes, unit), np.linalg.norm(misses_m, axis=1)
        units = [max(float(np.sqrt(weights @ v**2)), 1e-12) for v in (doubt, slope_m)]
        squares = np.stack([doubt / units[0], slope_m / units[1]]) ** 2

        def loss(part: float) -> float:
            relative = np.sqrt(np.maximum((1 - part, part) @ squares, 1e-12))
            level = max(float(weights @ (sizes_m / relative)), 1e-12)
            misfit = 2 * (weights @ np.log(relative) + np.log(level))
            return float(len(weights) * misfit - np.log(part * (1 - part)))

        part = min(_PARTS, key=loss)
        of_doubt, of_slope = np.sqrt([1 - part, part]) / units
        relative = np.hypot(of_doubt * doubt, of_slope * slope_m)
        scale = held_out_scale(misses_m, relative, weights)
        return cls(unit, float(of_doubt), float(of_slope), scale)


class Doubting(Protocol):
    """A forward model that knows how unsure it is, but not in metres."""

    def predict(self, actions: np.ndarray) -> np.ndarray: ...

    def slopes(self, actions: np.ndarray) -> np.ndarray: ...

    def doubt(self, actions: np.ndarray) -> np.ndarray: ...


def sized(model: Doubting, casts: Examples, unit: np.ndarray) -> Spread:
    """Return the spread that held-out casts show of a model."""
    return Spread.of(
        casts.endpoints_m - model.predict(casts.actions),
        model.doubt(casts.actions),
        model.slopes(casts.actions),
        unit,
        casts.weights,
    )


def slope_size(slopes: np.ndarray, unit: np.ndarray) -> np.ndarray:
    """Return |S| (n,) [m] of slopes (n, 2, d) for actions in units of `unit` (d,)."""
    return np.linalg.norm(slopes * unit, axis=(1, 2))


def held_out_scale(misses_m: np.ndarray, relative: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the spread [m] that a relative spread of 1 means, for x and y, (2,).

    It is chosen so that 68 % of the held-out casts, by weight, miss by less than their spread.
    The quantile is the next larger one that n casts have (Vovk et al. 2005), so that few casts
    make a model say too much spread rather than too little; whip-like casts that miss by far
    count no more than others.

    Parameters
    ----------
    misses_m : ndarray of shape (n, 2), measured minus predicted endpoints.
    relative : ndarray of shape (n,), what the model says of its spread, up to a factor.
    weights : ndarray of shape (n,).
    """
    ratios = np.abs(misses_m) / relative[:, None]
    order = np.argsort(ratios, axis=0, kind="stable")
    part = np.cumsum(weights[order], axis=0) / weights.sum()
    wanted = min(1.0, _WITHIN * (1 + 1 / len(ratios))) - 1e-12
    return np.array(
        [ratios[order[np.searchsorted(part[:, c], wanted), c], c] for c in range(ratios.shape[1])]
    )
