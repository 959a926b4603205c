"""How far casts end from where a forward model says, set on casts held out from its training."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any, Protocol

import numpy as np

from robotcast.policies.learning.datasets import Examples

_TINY = 1e-12
_WITHIN = 0.6827  # part of a normal distribution within one standard deviation
_DOUBT_POWERS = np.linspace(0.0, 1.0, 5)  # that are tried
_SLOPE_POWERS = np.linspace(0.0, 1.25, 6)
_USUAL, _APART = 0.5, 0.5  # mean and deviation of both, before a cast is seen


@dataclass(frozen=True)
class Spread:
    """Standard deviations scale · d^p |S|^q of an endpoint, for a doubt d and a slope S.

    A model doubts where its examples scattered or were few. And wherever the endpoint moves far
    with the action, a model that is a little wrong, and chance in the arm, the cable and the
    board, move it far too: how far a cast ends from its prediction follows the slope more than
    the doubt, above all of a network that learned from few casts, which it hardly misses.

    Attributes
    ----------
    unit : ndarray of shape (d,), of the numbers of an action, that S = ∂endpoint/∂action takes.
    powers : p and q.
    least : least doubt and least slope [m] of the casts it was set on: calmer is not believed.
    scale : ndarray of shape (2,), for x and y.
    """

    unit: np.ndarray
    powers: tuple[float, float]
    least: tuple[float, float]
    scale: np.ndarray

    def __call__(self, doubt: np.ndarray, slopes: np.ndarray) -> np.ndarray:
        """Return standard deviations (n, 2) [m].

        Parameters
        ----------
        doubt : ndarray of shape (n,), the model's, up to a factor.
        slopes : ndarray of shape (n, 2, d).
        """
        return self._relative(doubt, slope_size(slopes, self.unit))[:, None] * self.scale

    def _relative(self, doubt: np.ndarray, slope_m: np.ndarray) -> np.ndarray:
        (p, q), (least, least_m) = self.powers, self.least
        return np.maximum(doubt, least) ** p * np.maximum(slope_m, least_m) ** q

    def as_dict(self) -> dict[str, Any]:
        """Return plain numbers for a YAML file."""
        return {
            "unit": self.unit.tolist(),
            "powers": list(self.powers),
            "least": list(self.least),
            "scale": self.scale.tolist(),
        }

    @classmethod
    def from_dict(cls, numbers: Mapping[str, Any]) -> "Spread":
        """Read back `as_dict`."""
        powers, least = tuple(numbers["powers"]), tuple(numbers["least"])
        return cls(np.array(numbers["unit"]), powers, least, np.array(numbers["scale"]))

    @classmethod
    def plain(cls, numbers: int) -> "Spread":
        """Return the spread that is the doubt itself, of actions of so many numbers."""
        return cls(np.ones(numbers), (1.0, 0.0), (0.0, 1.0), np.ones(2))

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

        The powers make the misses most likely, were their sizes distributed as Laplace's, and
        few casts move them little from a half each.

        Parameters
        ----------
        misses_m : ndarray of shape (n, 2), measured minus predicted endpoints.
        weights : ndarray of shape (n,).
        """
        part = weights / weights.sum()
        slope_m, sizes_m = slope_size(slopes, unit), np.linalg.norm(misses_m, axis=1)
        least = max(float(doubt.min()), _TINY), max(float(slope_m.min()), _TINY)

        def of_powers(powers: tuple[float, float]) -> np.ndarray:
            return cls(unit, powers, least, np.ones(2))._relative(doubt, slope_m)

        def loss(powers: tuple[float, float]) -> float:
            relative = of_powers(powers)
            level = max(float(part @ (sizes_m / relative)), _TINY)
            misfit = 2 * float(part @ np.log(relative) + np.log(level))
            unusual = sum((power - _USUAL) ** 2 for power in powers) / (2 * _APART**2)
            return len(part) * misfit + unusual

        p, q = min(product(_DOUBT_POWERS.tolist(), _SLOPE_POWERS.tolist()), key=loss)
        scale = held_out_scale(misses_m, of_powers((p, q)), weights)
        return cls(unit, (p, q), least, scale)


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
