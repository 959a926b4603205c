"""The fully connected network f_forw (paper, "Forward Dynamics Model")."""

import hashlib
import io
import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import polars as pl
import torch
import yaml
from safetensors.torch import load_file, save_file
from torch import nn

from robotcast.files import atomic_file, write_text
from robotcast.policies.datasets import Dataset, Examples
from robotcast.policies.normalisation import Normalisation
from robotcast.progress import Progress, silent

_PREDICT_ROWS = 8192


@dataclass(frozen=True)
class Epoch:
    """How one pass over the training examples ended."""

    epoch: int
    training_loss: float
    validation_loss: float
    validation_median_m: float


@dataclass(frozen=True)
class Network:
    """A fitted network with what it needs to be used and what it was made from.

    Attributes
    ----------
    actions, endpoints : normalisations, computed on the training examples.
    history : one entry an epoch; `best_epoch` is the one whose weights these are.
    """

    layers: nn.Sequential
    hidden: tuple[int, ...]
    actions: Normalisation
    endpoints: Normalisation
    dataset: str
    facts: Mapping[str, int | float]
    seed: int
    best_epoch: int
    history: tuple[Epoch, ...]

    def predict(self, actions: np.ndarray) -> np.ndarray:
        """Predict endpoints (n, 2) [m] of actions (n, 6)."""
        inputs = torch.from_numpy(self.actions.apply(actions).astype(np.float32))
        with _reproducible_torch(self.seed), torch.inference_mode():
            outputs = [self.layers(rows).numpy() for rows in inputs.split(_PREDICT_ROWS)]
        return self.endpoints.undo(np.concatenate(outputs).astype(float))

    def save(self, folder: Path) -> None:
        """Write weights.safetensors, training.csv and, last, policy.yaml into `folder`."""
        weights = folder / "weights.safetensors"
        with atomic_file(weights) as temporary:
            save_file(self.layers.state_dict(), temporary)
        text = io.StringIO()
        pl.DataFrame([vars(e) for e in self.history]).write_csv(text, float_precision=6)
        write_text(folder / "training.csv", text.getvalue())
        best = next(e for e in self.history if e.epoch == self.best_epoch)
        description = {
            "dataset": self.dataset,
            "seed": self.seed,
            "hidden": list(self.hidden),
            "examples": dict(self.facts),
            "epochs": len(self.history),
            "best_epoch": self.best_epoch,
            "validation_median_m": round(best.validation_median_m, 6),
            "normalisation": {
                "actions": self.actions.as_dict(),
                "endpoints_m": self.endpoints.as_dict(),
            },
            "weights_sha256": hashlib.sha256(weights.read_bytes()).hexdigest(),
        }
        write_text(folder / "policy.yaml", yaml.safe_dump(description, sort_keys=False))


@dataclass(frozen=True)
class NetworkLearner:
    """Trains a network by Adam on mini-batches, with early stopping.

    Attributes
    ----------
    hidden : widths of the hidden layers.
    epochs : at most so many passes; the learning rate falls to zero along a cosine over them.
    patience : passes without a better validation loss before it stops.
    """

    hidden: tuple[int, ...]
    batch_size: int
    learning_rate: float
    weight_decay: float
    epochs: int
    patience: int

    def __post_init__(self) -> None:
        for name in ("batch_size", "learning_rate", "epochs", "patience"):
            if getattr(self, name) <= 0:
                raise ValueError(f"policy nn: {name} must be positive, got {getattr(self, name)}")

    def fit(self, dataset: Dataset, *, seed: int, progress: Progress = silent) -> Network:
        """Train on `dataset.training`, keep the weights best on `dataset.validation`."""
        actions = Normalisation.of(dataset.training.actions)
        endpoints = Normalisation.of(dataset.training.endpoints_m)
        training = _tensors(dataset.training, actions, endpoints)
        validation = _tensors(dataset.validation, actions, endpoints)
        with _reproducible_torch(seed):
            layers = _layers(tuple(self.hidden))
            history, best = self._train(layers, training, validation, endpoints, seed, progress)
            layers.load_state_dict(best)
        best_epoch = min(history, key=lambda e: e.validation_loss).epoch
        return Network(
            layers,
            tuple(self.hidden),
            actions,
            endpoints,
            dataset.name,
            dataset.facts,
            seed,
            best_epoch,
            tuple(history),
        )

    def load(self, folder: Path) -> Network:
        """Read a network that `Network.save` wrote."""
        description_path = folder / "policy.yaml"
        if not description_path.exists():
            raise FileNotFoundError(f"{description_path} is missing: run the train stage first")
        told = yaml.safe_load(description_path.read_text(encoding="utf-8"))
        weights = folder / "weights.safetensors"
        if hashlib.sha256(weights.read_bytes()).hexdigest() != told["weights_sha256"]:
            raise ValueError(f"{weights} does not belong to policy.yaml beside it: train again")
        hidden = tuple(told["hidden"])
        layers = _layers(hidden)
        layers.load_state_dict(load_file(weights))
        history = pl.read_csv(folder / "training.csv").iter_rows(named=True)
        return Network(
            layers,
            hidden,
            Normalisation.from_dict(told["normalisation"]["actions"]),
            Normalisation.from_dict(told["normalisation"]["endpoints_m"]),
            told["dataset"],
            told["examples"],
            told["seed"],
            told["best_epoch"],
            tuple(Epoch(**row) for row in history),
        )

    def _train(self, layers, training, validation, endpoints, seed, progress):
        optimizer = torch.optim.Adam(
            layers.parameters(), lr=self.learning_rate, weight_decay=self.weight_decay
        )
        rng = np.random.default_rng(np.random.SeedSequence((seed, 2)))
        history: list[Epoch] = []
        best, best_loss, best_epoch = {}, math.inf, 0
        for epoch in range(1, self.epochs + 1):
            for group in optimizer.param_groups:
                turn = math.pi * (epoch - 1) / self.epochs
                group["lr"] = self.learning_rate * (1 + math.cos(turn)) / 2
            loss = self._one_epoch(layers, optimizer, training, rng)
            history.append(_judge(layers, epoch, loss, validation, endpoints))
            if history[-1].validation_loss < best_loss:
                best_loss, best_epoch = history[-1].validation_loss, epoch
                best = {name: value.clone() for name, value in layers.state_dict().items()}
            median_mm = 1000 * history[best_epoch - 1].validation_median_m if best_epoch else 0.0
            progress(epoch, self.epochs, f"median {median_mm:.1f} mm")
            if epoch - best_epoch >= self.patience:
                break
        if not best:
            raise ValueError("training diverged from the first epoch: lower the learning rate")
        return history, best

    def _one_epoch(self, layers, optimizer, training, rng) -> float:
        inputs, outputs, weights = training
        order = torch.from_numpy(rng.permutation(len(inputs)))
        total = 0.0
        for rows in order.split(self.batch_size):
            optimizer.zero_grad(set_to_none=True)
            loss = _loss(layers(inputs[rows]), outputs[rows], weights[rows])
            loss.backward()
            optimizer.step()
            total += loss.item() * len(rows)
        return total / len(inputs)


def _loss(predicted: torch.Tensor, wanted: torch.Tensor, weights: torch.Tensor) -> torch.Tensor:
    """Weighted mean of squared, normalised errors; predicted and wanted (n, 2), weights (n,)."""
    squared = (predicted - wanted).square().mean(dim=1)
    return (weights * squared).mean()


def _judge(layers, epoch, training_loss, validation, endpoints: Normalisation) -> Epoch:
    inputs, outputs, weights = validation
    with torch.inference_mode():
        predicted = torch.cat([layers(rows) for rows in inputs.split(_PREDICT_ROWS)])
        loss = _loss(predicted, outputs, weights).item()
    errors_m = np.linalg.norm((predicted - outputs).numpy() * endpoints.scale, axis=1)
    return Epoch(epoch, training_loss, loss, float(np.median(errors_m)))


def _layers(hidden: tuple[int, ...]) -> nn.Sequential:
    widths = [6, *hidden]
    modules: list[nn.Module] = []
    for width_in, width_out in pairwise(widths):
        modules += [nn.Linear(width_in, width_out), nn.ReLU()]
    return nn.Sequential(*modules, nn.Linear(widths[-1], 2))


def _tensors(examples: Examples, actions: Normalisation, endpoints: Normalisation):
    """Return normalised inputs (n, 6), outputs (n, 2) and weights (n,) of mean 1."""
    columns = (
        actions.apply(examples.actions),
        endpoints.apply(examples.endpoints_m),
        examples.weights / examples.weights.mean(),
    )
    return tuple(torch.from_numpy(column.astype(np.float32)) for column in columns)


@contextmanager
def _reproducible_torch(seed: int) -> Iterator[None]:
    """Make torch give the same bytes on any number of cores; its global state is put back."""
    threads = torch.get_num_threads()
    deterministic = torch.are_deterministic_algorithms_enabled()
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        torch.set_num_threads(1)
        torch.use_deterministic_algorithms(True)
        try:
            yield
        finally:
            torch.use_deterministic_algorithms(deterministic)
            torch.set_num_threads(threads)
