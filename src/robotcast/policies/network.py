"""The fully connected network f_forw (paper, "Forward Dynamics Model")."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import torch
from torch import nn

from robotcast.policies.normalisation import Normalisation
from robotcast.policies.reproducible import in_parts
from robotcast.policies.slopes import row_slopes
from robotcast.policies.storage import read_model, write_model
from robotcast.policies.training import Epoch

_SPREAD = "spread/"


@dataclass(frozen=True)
class LastLayerSpread:
    """How unsure the network is, from what its last hidden layer saw of the training examples.

    The last layer taken alone is Bayesian linear regression (MacKay 1992): the variance of a
    prediction grows by φᵀ A⁻¹ φ for features φ unlike those of the training examples.

    Attributes
    ----------
    root : tensor of shape (h + 1, h + 1), R with A⁻¹ = Rᵀ R.
    scale_m : tensor of shape (2,), spread of a cast amid the training examples.
    """

    root: torch.Tensor
    scale_m: torch.Tensor

    def relative(self, features: torch.Tensor) -> torch.Tensor:
        """Return √(1 + φᵀ A⁻¹ φ), (n,), of features (n, h)."""
        return torch.sqrt(1 + (with_one(features) @ self.root.T).square().sum(dim=1))


@dataclass(frozen=True)
class Network:
    """A fitted network with what it needs to be used and what it was made from.

    Attributes
    ----------
    actions, endpoints : normalisations, computed on the training examples.
    history : one entry an epoch; the weights are those of the best.
    """

    layers: nn.Sequential
    hidden: tuple[int, ...]
    actions: Normalisation
    endpoints: Normalisation
    uncertainty: LastLayerSpread
    dataset: str
    facts: Mapping[str, object]
    seed: int
    history: tuple[Epoch, ...]

    def predict(self, actions: np.ndarray) -> np.ndarray:
        """Predict endpoints (n, 2) [m] of actions (n, 6)."""
        return self.endpoints.undo(
            in_parts(self.layers, self._inputs(actions)).numpy().astype(float)
        )

    def spread(self, actions: np.ndarray) -> np.ndarray:
        """Return standard deviations (n, 2) [m] of a cast's endpoint about the prediction."""

        def relative(rows: torch.Tensor) -> torch.Tensor:
            return self.uncertainty.relative(self.layers[:-1](rows))

        found = in_parts(relative, self._inputs(actions)).numpy().astype(float)
        return found[:, None] * self.uncertainty.scale_m.numpy()

    def slopes(self, actions: np.ndarray) -> np.ndarray:
        """Return the endpoint's derivatives (n, 2, 6) by the numbers of actions (n, 6)."""
        mean, scale = (torch.from_numpy(v) for v in (self.actions.mean, self.actions.scale))
        unit_m = torch.from_numpy(self.endpoints.scale)

        def endpoints(rows: torch.Tensor) -> torch.Tensor:
            return self.layers(((rows - mean) / scale).float()).double() * unit_m

        return row_slopes(endpoints, actions)

    def save(self, folder: Path) -> None:
        """Write weights.safetensors, training.csv and, last, policy.yaml into `folder`."""
        spread = {"root": self.uncertainty.root, "scale_m": self.uncertainty.scale_m}
        tensors = {**self.layers.state_dict(), **{_SPREAD + name: v for name, v in spread.items()}}
        told = {
            "kind": "network",
            "dataset": self.dataset,
            "seed": self.seed,
            "hidden": list(self.hidden),
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
        spread = [stored.tensors.pop(_SPREAD + name) for name in ("root", "scale_m")]
        layers = make_layers(hidden)
        layers.load_state_dict(stored.tensors)
        return cls(
            layers,
            hidden,
            Normalisation.from_dict(told["normalisation"]["actions"]),
            Normalisation.from_dict(told["normalisation"]["endpoints_m"]),
            LastLayerSpread(*spread),
            told["dataset"],
            told["examples"],
            told["seed"],
            stored.history,
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
