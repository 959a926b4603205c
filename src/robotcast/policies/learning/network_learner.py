"""Training of the network by mini-batches."""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from torch import nn
from torch.nn.functional import huber_loss

from robotcast.policies.learning.datasets import Dataset, Examples
from robotcast.policies.learning.judging import Held
from robotcast.policies.learning.network import LastLayerDoubt, Network, make_layers, with_one
from robotcast.policies.learning.normalisation import Normalisation
from robotcast.policies.learning.reproducible import reproducible_torch
from robotcast.policies.learning.rows import Rows
from robotcast.policies.learning.scatter import fit_scatter
from robotcast.policies.learning.spread import Spread, sized
from robotcast.policies.learning.training import subject_of, train
from robotcast.progress import Progress, silent

_JUDGED_AT_ONCE = 8192
_AVERAGED_PASSES = 5
_PRIOR_PRECISION = 1.0  # of the last layer's weights: as much as one example with features of 1


@dataclass(frozen=True)
class NetworkLearner:
    """Trains a network by Adam on mini-batches, with early stopping.

    Attributes
    ----------
    hidden : widths of the hidden layers.
    outlier_m : errors beyond it count linearly instead of squared; whip-like casts amplify small
        differences, and the few that no smooth function explains must not bend the others.
        Misses of held-out casts beyond it count even less.
    passes : at most so many passes; the learning rate falls to zero along a cosine over them.
    patience : passes without a better validation loss before it stops.
    """

    hidden: tuple[int, ...]
    batch_size: int
    learning_rate: float
    weight_decay: float
    outlier_m: float
    passes: int
    patience: int

    def __post_init__(self) -> None:
        for name in ("batch_size", "learning_rate", "outlier_m", "passes", "patience"):
            if getattr(self, name) <= 0:
                raise ValueError(f"policy nn: {name} must be positive, got {getattr(self, name)}")

    def fit(
        self,
        dataset: Dataset,
        *,
        seed: int,
        unfinished: Path | None = None,
        progress: Progress = silent,
    ) -> Network:
        """Train on `dataset.training`, keep the weights best on `dataset.validation`."""
        actions = Normalisation.of(dataset.training.actions)
        endpoints = Normalisation.of(dataset.training.endpoints_m)
        training = _rows(dataset.training, actions, endpoints)
        held = Held(dataset.validation, actions, endpoints, self.outlier_m)
        loss = _Loss(torch.from_numpy(endpoints.scale.astype(np.float32)), self.outlier_m)
        with reproducible_torch(seed):
            layers, moving = (make_layers(tuple(self.hidden)) for _ in range(2))
            adam = torch.optim.Adam(
                moving.parameters(), lr=self.learning_rate, weight_decay=self.weight_decay
            )
            both = nn.ModuleDict({"moving": moving, "averaged": layers})
            history = train(
                _NetworkFit(both, adam, training, held, loss, self, seed),
                passes=self.passes,
                patience=self.patience,
                unfinished=unfinished,
                subject=subject_of(dataset, self, seed),
                progress=progress,
            )
            last_layer = _last_layer(layers, training, loss.scale_m)
        network = Network(
            layers=layers,
            hidden=tuple(self.hidden),
            actions=actions,
            endpoints=endpoints,
            last_layer=last_layer,
            dataset=dataset.name,
            facts=dataset.facts,
            seed=seed,
            history=history,
            size=Spread.plain(actions.mean.size),
        )
        return replace(network, size=sized(network, dataset.calibration, actions.scale))

    def shortened(self, passes: int) -> "NetworkLearner":
        """Return a learner of fewer passes, to try settings with."""
        return replace(self, passes=min(passes, self.passes))

    def load(self, folder: Path) -> Network:
        """Read a network that `Network.save` wrote."""
        return Network.load(folder)


@dataclass(frozen=True)
class _Loss:
    """Weighted mean of Huber's function of each coordinate's error, in units of `outlier_m`.

    Attributes
    ----------
    scale_m : tensor of shape (2,), metres in one unit of normalised output.
    """

    scale_m: torch.Tensor
    outlier_m: float

    def __call__(
        self, predicted: torch.Tensor, wanted: torch.Tensor, weights: torch.Tensor
    ) -> torch.Tensor:
        """Compare normalised endpoints (n, 2) under weights (n,)."""
        away = (predicted - wanted) * (self.scale_m / self.outlier_m)
        costs = huber_loss(away, torch.zeros_like(away), reduction="none")
        return (weights * costs.sum(dim=1)).mean()


@dataclass(frozen=True)
class _NetworkFit:
    """The network in training, and its weights averaged over the last few passes.

    The average is what is judged and kept (Polyak and Juditsky 1992): weights that still move
    jump from pass to pass, and the one that hits a few held-out casts best is no better elsewhere.
    """

    module: nn.ModuleDict
    optimizer: torch.optim.Optimizer
    training: Rows
    held: Held
    loss: _Loss
    settings: NetworkLearner
    seed: int

    def one_pass(self, number: int) -> float:
        """Pass over all training examples once; return the mean loss on the way."""
        done = (number - 1) / self.settings.passes
        for group in self.optimizer.param_groups:
            group["lr"] = self.settings.learning_rate * (1 + math.cos(math.pi * done)) / 2
        rng = np.random.default_rng(np.random.SeedSequence((self.seed, 2, number)))
        order = torch.from_numpy(rng.permutation(len(self.training.weights)))
        batches, total = order.split(self.settings.batch_size), 0.0
        for step, rows in enumerate(batches, start=(number - 1) * len(batches) + 1):
            self.optimizer.zero_grad(set_to_none=True)
            wanted, weights = self.training.endpoints[rows], self.training.weights[rows]
            predicted = self.module["moving"](self.training.actions[rows])
            batch_loss = self.loss(predicted, wanted, weights)
            batch_loss.backward()
            self.optimizer.step()
            self._average(1 / min(step, _AVERAGED_PASSES * len(batches)))
            total += batch_loss.item() * len(rows)
        return total / len(order)

    def _average(self, share: float) -> None:
        """Move the average by this share towards the weights as they are."""
        pairs = zip(
            self.module["averaged"].parameters(), self.module["moving"].parameters(), strict=True
        )
        with torch.no_grad():
            for average, now in pairs:
                average.lerp_(now, share)

    def judge(self) -> tuple[float, float]:
        """Return the loss on the held-out casts and the median miss there [m]."""
        with torch.inference_mode():
            return self.held.judge(
                lambda inputs: _all(
                    self.module["averaged"], torch.from_numpy(inputs).float()
                ).numpy()
            )


def _last_layer(layers: nn.Sequential, training: Rows, scale_m: torch.Tensor) -> LastLayerDoubt:
    """Learn the doubt from the training examples."""
    with torch.inference_mode():
        features = _all(layers[:-1], training.actions)
        away_m = (layers[-1](features) - training.endpoints) * scale_m
        sizes_m = torch.linalg.norm(away_m, dim=1).double()
        scatter = fit_scatter(features.double(), sizes_m, training.weights.double()).single()
        seen = with_one(features).double()
        precision = (training.weights.double()[:, None] * seen).T @ seen
        precision += _PRIOR_PRECISION * torch.eye(len(precision), dtype=torch.float64)
        lower = torch.linalg.cholesky(precision)
        unit = torch.eye(len(lower), dtype=torch.float64)
        root = torch.linalg.solve_triangular(lower, unit, upper=False).float()
    return LastLayerDoubt(root.clone(), scatter)


def _rows(examples: Examples, actions: Normalisation, endpoints: Normalisation) -> Rows:
    """Return normalised examples whose weights have mean 1."""
    even = examples.weighted(1 / examples.weights.mean())
    return Rows.of(even, actions, endpoints, torch.float32)


def _all(module: nn.Module, rows: torch.Tensor) -> torch.Tensor:
    return torch.cat([module(part) for part in rows.split(_JUDGED_AT_ONCE)])
