"""The fully connected network f_forw (paper, "Forward Dynamics Model")."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import torch
from torch import nn

from robotcast.policies.learning.normalisation import Normalisation
from robotcast.policies.learning.reproducible import in_parts
from robotcast.policies.learning.scatter import Scatter
from robotcast.policies.learning.slopes import row_slopes
from robotcast.policies.learning.spread import Spread
from robotcast.policies.learning.storage import read_model, write_model
from robotcast.policies.learning.training import Epoch

_DOUBT = "doubt/"


@dataclass(frozen=True)
class LastLayerDoubt:
    """How unsure the network is, from what its last hidden layer saw of the training examples.

    The last layer taken alone is Bayesian linear regression (MacKay 1992): the variance of a
    prediction grows by φᵀ A⁻¹ φ for features φ unlike those of the training examples.

    Attributes
    ----------
    root : tensor of shape (h + 1, h + 1), R with A⁻¹ = Rᵀ R.
    scatter : of casts about the network.
    """

    root: torch.Tensor
    scatter: Scatter

    def __call__(self, features: torch.Tensor) -> torch.Tensor:
        """Return the scatter times √(1 + φᵀ A⁻¹ φ), (n,), of features (n, h)."""
        unlike = (with_one(features) @ self.root.T).square().sum(dim=1)
        return self.scatter(features) * torch.sqrt(1 + unlike)

    def tensors(self) -> dict[str, torch.Tensor]:
        """Return what it is made of, by name, for a file."""
        scatter = {"scatter_weights": self.scatter.weights, "scatter_bounds": self.scatter.bounds}
        return {"root": self.root, **scatter}

    @classmethod
    def of(cls, tensors: Mapping[str, torch.Tensor]) -> "LastLayerDoubt":
        """Make it of `tensors`."""
        scatter = Scatter(tensors["scatter_weights"], tensors["scatter_bounds"])
        return cls(tensors["root"], scatter)


@dataclass(frozen=True)
class Network:
    """A fitted network with what it needs to be used and what it was made from.

    Attributes
    ----------
    actions, endpoints : normalisations, computed on the training examples.
    history : one entry an epoch; the weights are those of the best.
    size : of the spread, set on held-out casts.
    """

    layers: nn.Sequential
    hidden: tuple[int, ...]
    actions: Normalisation
    endpoints: Normalisation
    last_layer: LastLayerDoubt
    dataset: str
    facts: Mapping[str, object]
    seed: int
    history: tuple[Epoch, ...]
    size: Spread

    def predict(self, actions: np.ndarray) -> np.ndarray:
        """Predict endpoints (n, 2) [m] of actions (n, 6)."""
        return self.endpoints.undo(
            in_parts(self.layers, self._inputs(actions)).numpy().astype(float)
        )

    def spread(self, actions: np.ndarray) -> np.ndarray:
        """Return standard deviations (n, 2) [m] of a cast's endpoint about the prediction."""
        return self.size(self.doubt(actions), self.slopes(actions))

    def doubt(self, actions: np.ndarray) -> np.ndarray:
        """Return how unsure the network itself is of actions (n, 6), (n,), up to a factor."""

        def of_rows(rows: torch.Tensor) -> torch.Tensor:
            return self.last_layer(self.layers[:-1](rows))

        return in_parts(of_rows, self._inputs(actions)).numpy().astype(float)

    def slopes(self, actions: np.ndarray) -> np.ndarray:
        """Return the endpoint's derivatives (n, 2, 6) by the numbers of actions (n, 6)."""
        slopes = row_slopes(self.layers, self._inputs(actions)).numpy().astype(float)
        return slopes * self.endpoints.scale[:, None] / self.actions.scale

    def save(self, folder: Path) -> None:
        """Write weights.safetensors, training.csv and, last, policy.yaml into `folder`."""
        doubt = {_DOUBT + name: v for name, v in self.last_layer.tensors().items()}
        tensors = {**self.layers.state_dict(), **doubt}
        told = {
            "kind": "network",
            "dataset": self.dataset,
            "seed": self.seed,
            "hidden": list(self.hidden),
            "spread": self.size.as_dict(),
            "examples": dict(self.facts),
            "normalisation": {
                "actions": self.actions.as_dict(),
                "endpoints_m": self.endpoints.as_dict(),
            },
        }
        write_model(folder, tensors, told, self.history)

    @classmethod
    def load(cls, folder: Path) -> "Network":
        """Read a network that `save` wrote."""
        stored = read_model(folder)
        told, hidden = stored.told, tuple(stored.told["hidden"])
        doubt = {
            n.removeprefix(_DOUBT): v for n, v in stored.tensors.items() if n.startswith(_DOUBT)
        }
        layers = make_layers(hidden)
        layers.load_state_dict(
            {n: v for n, v in stored.tensors.items() if not n.startswith(_DOUBT)}
        )
        return cls(
            layers,
            hidden,
            Normalisation.from_dict(told["normalisation"]["actions"]),
            Normalisation.from_dict(told["normalisation"]["endpoints_m"]),
            LastLayerDoubt.of(doubt),
            told["dataset"],
            told["examples"],
            told["seed"],
            stored.history,
            Spread.from_dict(told["spread"]),
        )

    def _inputs(self, actions: np.ndarray) -> torch.Tensor:
        return torch.from_numpy(self.actions.apply(actions).astype(np.float32))


def make_layers(hidden: tuple[int, ...]) -> nn.Sequential:
    """Make fully connected layers from 6 normalised numbers to 2, ReLU between them."""
    widths = [6, *hidden]
    modules: list[nn.Module] = []
    for width_in, width_out in pairwise(widths):
        modules += [nn.Linear(width_in, width_out), nn.ReLU()]
    return nn.Sequential(*modules, nn.Linear(widths[-1], 2))


def with_one(features: torch.Tensor) -> torch.Tensor:
    """Return features (n, h) with a column of ones for the bias, (n, h + 1)."""
    return torch.cat([features, torch.ones(len(features), 1, dtype=features.dtype)], dim=1)
