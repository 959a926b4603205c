"""How far casts end from a smooth model, region by region: whip-like casts by far the most.

A network that is asked for the mean says nothing of it, and a Gaussian process believes in one
noise for all. Here the logarithm of the scatter is linear in the features that a fitted model
has of an action, fitted to the sizes of its misses by the likelihood of Laplace's distribution,
which a few wild casts do not sway as squares would.
"""

from dataclasses import dataclass

import torch

_DIRECTIONS = 32  # of the features that are used, at most
_EXAMPLES_A_DIRECTION = 50  # at least: few casts show one scatter for all
_ROUNDS = 100
_MOST_MISS = 5.0  # scatters that count of a miss in one round, so that rounds settle


@dataclass(frozen=True)
class Scatter:
    """The scatter of casts about a model, up to a factor.

    Attributes
    ----------
    weights : tensor of shape (h + 1,), of the features and of a constant, for the logarithm.
    bounds : tensor of shape (2,), the least and the largest logarithm among the examples: what
        lies beyond is not believed.
    """

    weights: torch.Tensor
    bounds: torch.Tensor

    def single(self) -> "Scatter":
        """Return the same in single precision, as networks compute."""
        return Scatter(self.weights.float(), self.bounds.float())

    def __call__(self, features: torch.Tensor) -> torch.Tensor:
        """Return the scatter (n,) where a model has features (n, h)."""
        logarithm = features @ self.weights[:-1] + self.weights[-1]
        return torch.exp(logarithm.clamp(self.bounds[0], self.bounds[1]))


def fit_scatter(features: torch.Tensor, misses: torch.Tensor, weights: torch.Tensor) -> Scatter:
    """Fit the scatter to the misses of a model.

    The features are reduced to their leading principal components, one for every so many
    examples; in these, scaled to unit variance, Fisher's information is the unit matrix.

    Parameters
    ----------
    features : tensor of shape (n, h), in double precision.
    misses : tensor of shape (n,), sizes of the misses, in any unit.
    weights : tensor of shape (n,).
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
        ratio = (sizes / torch.exp(level + directions @ along)).clamp_max(_MOST_MISS)
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
