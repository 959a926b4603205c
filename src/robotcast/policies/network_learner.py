"""Training of the network by mini-batches with early stopping."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import nn
from torch.nn.functional import huber_loss

from robotcast.policies.datasets import Dataset, Examples
from robotcast.policies.network import Epoch, Network, make_layers, reproducible_torch
from robotcast.policies.normalisation import Normalisation
from robotcast.progress import Progress, silent

_JUDGED_AT_ONCE = 8192


@dataclass(frozen=True)
class NetworkLearner:
    """Trains a network by Adam on mini-batches, with early stopping.

    Attributes
    ----------
    hidden : widths of the hidden layers.
    outlier_m : errors beyond it count linearly instead of squared; whip-like casts amplify small
        differences, and the few that no smooth function explains must not bend the others.
    epochs : at most so many passes; the learning rate falls to zero along a cosine over them.
    patience : passes without a better validation loss before it stops.
    """

    hidden: tuple[int, ...]
    batch_size: int
    learning_rate: float
    weight_decay: float
    outlier_m: float
    epochs: int
    patience: int

    def __post_init__(self) -> None:
        for name in ("batch_size", "learning_rate", "outlier_m", "epochs", "patience"):
            if getattr(self, name) <= 0:
                raise ValueError(f"policy nn: {name} must be positive, got {getattr(self, name)}")

    def fit(self, dataset: Dataset, *, seed: int, progress: Progress = silent) -> Network:
        """Train on `dataset.training`, keep the weights best on `dataset.validation`."""
        actions = Normalisation.of(dataset.training.actions)
        endpoints = Normalisation.of(dataset.training.endpoints_m)
        training = _Rows.of(dataset.training, actions, endpoints)
        validation = _Rows.of(dataset.validation, actions, endpoints)
        loss = _Loss(torch.from_numpy(endpoints.scale.astype(np.float32)), self.outlier_m)
        with reproducible_torch(seed):
            layers = make_layers(tuple(self.hidden))
            history = self._train(layers, training, validation, loss, seed, progress)
        return Network(
            layers=layers,
            hidden=tuple(self.hidden),
            actions=actions,
            endpoints=endpoints,
            dataset=dataset.name,
            facts=dataset.facts,
            seed=seed,
            best_epoch=min(history, key=lambda e: e.validation_loss).epoch,
            history=tuple(history),
        )

    def load(self, folder: Path) -> Network:
        """Read a network that `Network.save` wrote."""
        return Network.load(folder)

    def _train(
        self,
        layers: nn.Sequential,
        training: "_Rows",
        validation: "_Rows",
        loss: "_Loss",
        seed: int,
        progress: Progress,
    ) -> list[Epoch]:
        """Train `layers` in place, leave the best epoch's weights in them, return all epochs."""
        optimizer = torch.optim.Adam(
            layers.parameters(), lr=self.learning_rate, weight_decay=self.weight_decay
        )
        schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, self.epochs)
        rng = np.random.default_rng(np.random.SeedSequence((seed, 2)))
        history: list[Epoch] = []
        best, best_weights = Epoch(0, math.inf, math.inf, math.inf), {}
        for number in range(1, self.epochs + 1):
            training_loss = self._one_epoch(layers, optimizer, training, loss, rng)
            schedule.step()
            epoch = _judge(layers, number, training_loss, validation, loss)
            history.append(epoch)
            if epoch.validation_loss < best.validation_loss:
                best = epoch
                best_weights = {name: v.clone() for name, v in layers.state_dict().items()}
            progress(number, self.epochs, f"median {1000 * best.validation_median_m:.1f} mm")
            if number - best.epoch >= self.patience:
                break
        if not best_weights:
            raise ValueError("training diverged from the first epoch: lower the learning rate")
        layers.load_state_dict(best_weights)
        return history

    def _one_epoch(
        self,
        layers: nn.Sequential,
        optimizer: torch.optim.Optimizer,
        training: "_Rows",
        loss: "_Loss",
        rng: np.random.Generator,
    ) -> float:
        """Pass over all training examples once; return the mean loss on the way."""
        order = torch.from_numpy(rng.permutation(len(training.weights)))
        total = 0.0
        for rows in order.split(self.batch_size):
            optimizer.zero_grad(set_to_none=True)
            wanted, weights = training.endpoints[rows], training.weights[rows]
            batch_loss = loss(layers(training.actions[rows]), wanted, weights)
            batch_loss.backward()
            optimizer.step()
            total += batch_loss.item() * len(rows)
        return total / len(order)


@dataclass(frozen=True)
class _Rows:
    """Normalised examples: actions (n, 6), endpoints (n, 2), weights (n,) of mean 1."""

    actions: torch.Tensor
    endpoints: torch.Tensor
    weights: torch.Tensor

    @classmethod
    def of(cls, examples: Examples, actions: Normalisation, endpoints: Normalisation) -> "_Rows":
        columns = (
            actions.apply(examples.actions),
            endpoints.apply(examples.endpoints_m),
            examples.weights / examples.weights.mean(),
        )
        return cls(*(torch.from_numpy(column.astype(np.float32)) for column in columns))


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


def _judge(
    layers: nn.Sequential, number: int, training_loss: float, validation: _Rows, loss: _Loss
) -> Epoch:
    with torch.inference_mode():
        parts = validation.actions.split(_JUDGED_AT_ONCE)
        predicted = torch.cat([layers(rows) for rows in parts])
        validation_loss = loss(predicted, validation.endpoints, validation.weights).item()
        away_m = torch.linalg.norm((predicted - validation.endpoints) * loss.scale_m, dim=1)
    return Epoch(number, training_loss, validation_loss, float(np.median(away_m.numpy())))
