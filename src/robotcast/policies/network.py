"""The fully connected network f_forw (paper, "Forward Dynamics Model") and its training."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain, pairwise
from typing import Any

import numpy as np
import torch
from torch import nn
from torch.nn.functional import huber_loss, pad
from torch.optim.swa_utils import AveragedModel

from robotcast.policies.datasets import Dataset
from robotcast.policies.forward_model import Epoch, LearnedModel, Tensors
from robotcast.policies.training import Fit, Learner

_ROWS_AT_ONCE = 8192
_AVERAGED_PASSES = 5
_PRIOR_PRECISION = 1.0  # of the last layer's weights: as much as one example with features of 1
_DOUBT = "doubt/root", "doubt/scatter_weights", "doubt/scatter_bounds"
_DIRECTIONS = 32  # of the features that a scatter is fitted in, at most
_EXAMPLES_A_DIRECTION = 50  # at least: few casts show one scatter for all
_ROUNDS = 100
_LARGEST_RATIO = 5.0  # of a miss to its scatter in one round, so that rounds settle


@dataclass(frozen=True)
class Scatter:
    """The scatter of casts about a model, up to a factor: log-linear in the model's features."""

    weights: torch.Tensor  # (h + 1,), of the features and of a constant
    bounds: torch.Tensor  # (2,), logarithms among the examples: nothing beyond is believed

    def __call__(self, features: torch.Tensor) -> torch.Tensor:
        """Return the scatter (n,) where a model has features (n, h)."""
        logarithm = features @ self.weights[:-1] + self.weights[-1]
        return torch.exp(logarithm.clamp(self.bounds[0], self.bounds[1]))


def fit_scatter(features: torch.Tensor, misses: torch.Tensor, weights: torch.Tensor) -> Scatter:
    """Fit the scatter to the sizes of a model's `misses` (n,) by Laplace's distribution.

    A few wild casts do not sway it as squares would. The `features` (n, h), in double precision,
    are reduced to their leading principal components, one for every so many examples; in these,
    scaled to unit variance, Fisher's information is the unit matrix.
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
    bounds = torch.stack((level + directions @ along).aminmax())
    return Scatter(torch.cat([turned, (level - mean @ turned)[None]]), bounds)


@dataclass(frozen=True, kw_only=True)
class Network(LearnedModel):
    """A fitted network, about which casts scatter.

    Its last layer taken alone is Bayesian linear regression (MacKay 1992): the variance of a
    prediction grows by φᵀ A⁻¹ φ for features φ (h,) unlike those of the training examples.
    """

    precision = torch.float32
    layers: nn.Sequential
    root: torch.Tensor  # (h + 1, h + 1), R with A⁻¹ = Rᵀ R
    scatter: Scatter

    def mean(self, rows: torch.Tensor) -> torch.Tensor:
        return self.layers(rows)

    def deviation(self, rows: torch.Tensor) -> torch.Tensor:
        """Return the scatter times √(1 + φᵀ A⁻¹ φ), (n,)."""
        features = self.layers[:-1](rows)
        with_bias = pad(features, (0, 1), value=1.0)
        unlike = (with_bias @ self.root.T).square().sum(dim=1)
        return self.scatter(features) * torch.sqrt(1 + unlike)

    def stored(self) -> tuple[dict[str, Any], Tensors]:
        *hidden, _ = (part.out_features for part in self.layers if isinstance(part, nn.Linear))
        doubt = zip(_DOUBT, (self.root, *vars(self.scatter).values()), strict=True)
        return {"kind": "network", "hidden": hidden}, {**self.layers.state_dict(), **dict(doubt)}

    @classmethod
    def restored(cls, settings: Any, tensors: Tensors, **shared: Any) -> "Network":
        root, *scatter = (tensors.pop(name) for name in _DOUBT)
        layers = make_layers(settings["hidden"])
        layers.load_state_dict(tensors)
        return cls(layers=layers, root=root, scatter=Scatter(*scatter), **shared)


class _NetworkFit(Fit):
    """The network in training, and its weights averaged over the last few passes.

    The average is what is judged and kept (Polyak and Juditsky 1992): weights that still move
    jump from pass to pass, and those that hit a few held-out casts best are no better on others.
    """

    def __init__(self, learner: Any, dataset: Dataset, seed: int) -> None:
        super().__init__(dataset, seed)
        self.learner, self.seed = learner, seed
        even = dataset.training.weighted(1 / dataset.training.weights.mean())
        self.inputs, self.ends, self.weights = self.tensors(even, torch.float32)
        self.scale_m = torch.from_numpy(self.endpoints.scale.astype(np.float32))
        averaged_steps = _AVERAGED_PASSES * -(-len(even) // learner.batch_size)

        def average(kept: torch.Tensor, now: torch.Tensor, steps: Any) -> torch.Tensor:
            return kept.lerp(now, 1 / min(int(steps) + 1, averaged_steps))

        self.averaged = AveragedModel(make_layers(learner.hidden), avg_fn=average)
        self.moving = make_layers(learner.hidden)
        self.module = nn.ModuleDict({"moving": self.moving, "averaged": self.averaged})
        rate, decay = learner.learning_rate, learner.weight_decay
        self.optimizer = torch.optim.Adam(self.moving.parameters(), lr=rate, weight_decay=decay)

    def one_pass(self, number: int) -> float:
        """Pass over all examples once; return the weighted mean of Huber's loss on the way."""
        done, total = (number - 1) / self.learner.passes, 0.0
        rate = self.learner.learning_rate * (1 + math.cos(math.pi * done)) / 2
        self.optimizer.param_groups[0]["lr"] = rate
        rng = np.random.default_rng((self.seed, 2, number))
        order = torch.from_numpy(rng.permutation(len(self.inputs)))
        for rows in order.split(self.learner.batch_size):
            self.optimizer.zero_grad(set_to_none=True)
            away = self.moving(self.inputs[rows]) - self.ends[rows]
            away = away * (self.scale_m / self.learner.outlier_m)
            costs = huber_loss(away, torch.zeros_like(away), reduction="none").sum(dim=1)
            loss = (self.weights[rows] * costs).mean()
            loss.backward()
            self.optimizer.step()
            self.averaged.update_parameters(self.moving)
            total += loss.item() * len(rows)
        return total / len(order)

    def predict(self, actions: np.ndarray) -> np.ndarray:
        rows = torch.from_numpy(self.actions.apply(actions)).float()
        with torch.inference_mode():
            return self.endpoints.undo(_all(self.averaged, rows).numpy())

    def model(self, history: tuple[Epoch, ...]) -> Network:
        layers: Any = self.averaged.module
        with torch.inference_mode():
            features = _all(layers[:-1], self.inputs)
            misses_m = torch.linalg.norm((layers[-1](features) - self.ends) * self.scale_m, dim=1)
            weights = self.weights.double()
            scatter = fit_scatter(features.double(), misses_m.double(), weights)
            seen = pad(features, (0, 1), value=1.0).double()  # a column of ones for the bias
            precision = (weights[:, None] * seen).T @ seen
            unit = torch.eye(len(precision), dtype=torch.float64)
            lower = torch.linalg.cholesky(precision + _PRIOR_PRECISION * unit)
            root = torch.linalg.solve_triangular(lower, unit, upper=False).float()
        scatter = Scatter(*(t.float() for t in vars(scatter).values()))
        doubt = {"root": root.clone(), "scatter": scatter}
        return Network(layers=layers, history=history, **doubt, **self.shared)


@dataclass(frozen=True, kw_only=True)
class NetworkLearner(Learner):
    """Trains a network with layers of widths `hidden` by Adam on mini-batches.

    The learning rate falls to zero along a cosine over all `passes`. Errors beyond `outlier_m`
    count linearly instead of squared: few whip-like casts must not bend the others.
    """

    name, kind, begin = "nn", Network, _NetworkFit
    positive = ("batch_size", *Learner.positive)
    hidden: Sequence[int]
    batch_size: int
    weight_decay: float


def make_layers(hidden: Sequence[int]) -> nn.Sequential:
    """Make fully connected layers from 6 normalised numbers to 2, ReLU between them."""
    widths = [6, *hidden]
    pairs = [(nn.Linear(before, after), nn.ReLU()) for before, after in pairwise(widths)]
    return nn.Sequential(*chain.from_iterable(pairs), nn.Linear(widths[-1], 2))


def _all(module: nn.Module, rows: torch.Tensor) -> torch.Tensor:
    return torch.cat([module(part) for part in rows.split(_ROWS_AT_ONCE)])
