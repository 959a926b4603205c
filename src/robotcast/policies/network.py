"""The fully connected network f_forw (paper, "Forward Dynamics Model")."""

import hashlib
import io
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
from robotcast.policies.normalisation import Normalisation

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
        with reproducible_torch(self.seed), torch.inference_mode():
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

    @classmethod
    def load(cls, folder: Path) -> "Network":
        """Read a network that `save` wrote."""
        description_path = folder / "policy.yaml"
        if not description_path.exists():
            raise FileNotFoundError(f"{description_path} is missing: run the train stage first")
        told = yaml.safe_load(description_path.read_text(encoding="utf-8"))
        weights = folder / "weights.safetensors"
        if hashlib.sha256(weights.read_bytes()).hexdigest() != told["weights_sha256"]:
            raise ValueError(f"{weights} does not belong to policy.yaml beside it: train again")
        hidden = tuple(told["hidden"])
        layers = make_layers(hidden)
        layers.load_state_dict(load_file(weights))
        history = pl.read_csv(folder / "training.csv").iter_rows(named=True)
        return cls(
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


def make_layers(hidden: tuple[int, ...]) -> nn.Sequential:
    """Make fully connected layers from 6 normalised numbers to 2, ReLU between them."""
    widths = [6, *hidden]
    modules: list[nn.Module] = []
    for width_in, width_out in pairwise(widths):
        modules += [nn.Linear(width_in, width_out), nn.ReLU()]
    return nn.Sequential(*modules, nn.Linear(widths[-1], 2))


@contextmanager
def reproducible_torch(seed: int) -> Iterator[None]:
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
