"""How far casts end from where a forward model says: where they scatter, and by how much."""

from dataclasses import dataclass
from itertools import product

import numpy as np
import torch

_TINY = 1e-12
_WITHIN = 0.6827  # part of a normal distribution within one standard deviation
_DOUBT_POWERS = np.linspace(0.0, 1.0, 5)  # that are tried
_SLOPE_POWERS = np.linspace(0.0, 1.25, 6)
_PRIOR_MEAN, _PRIOR_DEVIATION = 0.5, 0.5  # of both powers
_DIRECTIONS = 32  # of the features that a scatter is fitted in, at most
_EXAMPLES_A_DIRECTION = 50  # at least: few casts show one scatter for all
_ROUNDS = 100
_LARGEST_RATIO = 5.0  # of a miss to its scatter in one round, so that rounds settle


@dataclass(frozen=True)
class Spread:
    """Standard deviations scale · d^p |S|^q of an endpoint, for a doubt d and a slope S.

    A model doubts where its examples scattered or were few. And wherever the endpoint moves far
    with the action, a model that is a little wrong, and chance in the arm, the cable and the
    board, move it far too: how far a cast ends from its prediction follows the slope more than
    the doubt, above all of a network that learned from few casts, which it hardly misses.

    S = ∂endpoint/∂action takes the numbers of an action in units of `unit` (d,); `powers` are p
    and q; calmer than the `least` doubt and slope [m] of the casts it was set on is not believed;
    `scale` (2,) is for x and y.
    """

    unit: np.ndarray
    powers: np.ndarray
    least: np.ndarray
    scale: np.ndarray

    def __call__(self, doubt: np.ndarray, slopes: np.ndarray) -> np.ndarray:
        """Return standard deviations (n, 2) [m] of a model's doubt (n,) and slopes (n, 2, d)."""
        return self._relative(doubt, slope_size(slopes, self.unit))[:, None] * self.scale

    def _relative(self, doubt: np.ndarray, slope_m: np.ndarray) -> np.ndarray:
        (p, q), (least, least_m) = self.powers, self.least
        return np.maximum(doubt, least) ** p * np.maximum(slope_m, least_m) ** q

    @classmethod
    def of(
        cls,
        misses_m: np.ndarray,
        doubt: np.ndarray,
        slopes: np.ndarray,
        unit: np.ndarray,
        weights: np.ndarray,
    ) -> "Spread":
        """Set a spread on held-out casts with `misses_m` (n, 2) and `weights` (n,).

        The powers make the misses most likely, were their sizes distributed as Laplace's, and
        few casts move them little from a half each.
        """
        part = weights / weights.sum()
        slope_m, sizes_m = slope_size(slopes, unit), np.linalg.norm(misses_m, axis=1)
        least = np.maximum([doubt.min(), slope_m.min()], _TINY)

        def relative(powers: tuple[float, float]) -> np.ndarray:
            return cls(unit, np.array(powers), least, np.ones(2))._relative(doubt, slope_m)

        def loss(powers: tuple[float, float]) -> float:
            found = relative(powers)
            level = max(float(part @ (sizes_m / found)), _TINY)
            misfit = 2 * float(part @ np.log(found) + np.log(level))
            prior = sum((p - _PRIOR_MEAN) ** 2 for p in powers) / (2 * _PRIOR_DEVIATION**2)
            return len(part) * misfit + prior

        powers = min(product(_DOUBT_POWERS.tolist(), _SLOPE_POWERS.tolist()), key=loss)
        scale = held_out_scale(misses_m, relative(powers), weights)
        return cls(unit, np.array(powers), least, scale)


DOUBT_ALONE = Spread(np.ones(1), np.array([1.0, 0.0]), np.array([0.0, 1.0]), np.ones(2))


def slope_size(slopes: np.ndarray, unit: np.ndarray) -> np.ndarray:
    """Return |S| (n,) [m] of slopes (n, 2, d) for actions in units of `unit` (d,)."""
    return np.linalg.norm(slopes * unit, axis=(1, 2))


def held_out_scale(misses_m: np.ndarray, relative: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the spread [m] that a relative spread of 1 means, for x and y, (2,).

    It is chosen so that 68 % of the held-out casts, by `weights` (n,), have `misses_m` (n, 2) below
    their spread, `relative` (n,) of which is what the model expects. The quantile is the next
    larger one that n casts have (Vovk et al. 2005), so that few casts make a model say too much
    spread rather than too little; casts that miss by far count no more than others.
    """
    ratios = np.abs(misses_m) / relative[:, None]
    order = np.argsort(ratios, axis=0, kind="stable")
    part = np.cumsum(weights[order], axis=0) / weights.sum()
    wanted = min(1.0, _WITHIN * (1 + 1 / len(ratios))) - 1e-12
    found = [order[np.searchsorted(part[:, c], wanted), c] for c in (0, 1)]
    return ratios[found, [0, 1]]


@dataclass(frozen=True)
class Scatter:
    """The scatter of casts about a model, up to a factor: log-linear in the model's features.

    `weights` (h + 1,) are of the features and of a constant; `bounds` (2,) the least and the
    largest logarithm among the examples: what lies beyond is not believed.
    """

    weights: torch.Tensor
    bounds: torch.Tensor

    def __call__(self, features: torch.Tensor) -> torch.Tensor:
        """Return the scatter (n,) where a model has features (n, h)."""
        logarithm = features @ self.weights[:-1] + self.weights[-1]
        return torch.exp(logarithm.clamp(self.bounds[0], self.bounds[1]))


def fit_scatter(features: torch.Tensor, misses: torch.Tensor, weights: torch.Tensor) -> Scatter:
    """Fit the scatter to the sizes of a model's `misses` (n,), whip-like casts by far the largest.

    The likelihood is that of Laplace's distribution, which a few wild casts do not sway as squares
    would. The `features` (n, h), in double precision, are reduced to their leading principal
    components, one for every so many examples; in these, scaled to unit variance, Fisher's
    information is the unit matrix.
    """
    weights = weights / weights.sum()
    mean = weights @ features
    centred = features - mean
    variances, axes = torch.linalg.eigh((weights[:, None] * centred).T @ centred)
    used = min(_DIRECTIONS, len(features) // _EXAMPLES_A_DIRECTION)
    leading = variances.argsort(descending=True)[:used]
    leading = leading[variances[leading] > 1e-9 * variances.max()]
    basis = axes[:, leading] / variances[leading].sqrt()
    directions = centred @ basis
    sizes = misses / (weights @ misses).clamp_min(1e-12)
    along = torch.zeros(len(leading), dtype=features.dtype)
    level = torch.zeros((), dtype=features.dtype)
    for _ in range(_ROUNDS):
        ratio = (sizes / torch.exp(level + directions @ along)).clamp_max(_LARGEST_RATIO)
        surplus = weights * (ratio - 1)
        step, lift = directions.T @ surplus, surplus.sum()
        along, level = along + step, level + lift
        if max(step.abs().sum(), lift.abs()) < 1e-6:
            break
    turned = basis @ along
    logarithms = level + directions @ along
    return Scatter(
        torch.cat([turned, (level - mean @ turned)[None]]),
        torch.stack([logarithms.min(), logarithms.max()]),
    )
