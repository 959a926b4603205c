"""A Gaussian process as forward model (paper, "Baseline Policies"), exact or sparse."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
import torch

from robotcast.policies.learning.normalisation import Normalisation
from robotcast.policies.learning.reproducible import in_parts
from robotcast.policies.learning.slopes import row_slopes
from robotcast.policies.learning.spread import Spread
from robotcast.policies.learning.storage import read_model, write_model
from robotcast.policies.learning.training import Epoch


@dataclass(frozen=True)
class Posterior:
    """What a Gaussian process with a Matérn 5/2 kernel believes, told by its inducing points.

    Everything is in normalised units. x and y share the kernel. Double precision, because where
    casts hardly scatter, the mean of an exact process is a small difference of large numbers.

    Attributes
    ----------
    points : tensor of shape (m, 6), inducing points.
    lengths : tensor of shape (6,), of the kernel.
    variance, noise : tensors of shape (), of the function and of one cast.
    mean_weights : tensor of shape (m, 2); the mean is k(a, points) @ mean_weights.
    known : tensor of shape (m, m), V; the variance is k(a, a) − kᵀ V k.
    """

    points: torch.Tensor
    lengths: torch.Tensor
    variance: torch.Tensor
    noise: torch.Tensor
    mean_weights: torch.Tensor
    known: torch.Tensor

    def single(self) -> "Posterior":
        """Return the same in single precision, for sparse processes: half the time."""
        return Posterior(*(getattr(self, field.name).float() for field in fields(self)))

    def mean(self, rows: torch.Tensor) -> torch.Tensor:
        """Return normalised endpoints (n, 2) of normalised actions (n, 6)."""
        return self._kernel(rows) @ self.mean_weights

    def deviation(self, rows: torch.Tensor) -> torch.Tensor:
        """Return the standard deviation (n,) of one cast at normalised actions (n, 6)."""
        kernel = self._kernel(rows)
        left = self.variance - ((kernel @ self.known) * kernel).sum(dim=1)
        return torch.sqrt(left.clamp_min(0.0) + self.noise)

    def _kernel(self, rows: torch.Tensor) -> torch.Tensor:
        return self.variance * matern(rows, self.points, self.lengths)


def matern(rows: torch.Tensor, points: torch.Tensor, lengths: torch.Tensor) -> torch.Tensor:
    """Return the Matérn 5/2 correlation (n, m) of rows (n, d) with points (m, d).

    Expanded by hand: twice as fast as the library's over the 67 500 candidates.
    """
    one, other = rows / lengths, points / lengths
    squares = one.square().sum(dim=1, keepdim=True) + other.square().sum(dim=1)
    apart = (squares - 2 * one @ other.T).clamp_min(1e-30).mul(5.0)
    root = apart.sqrt()
    return (1 + root + apart / 3) * torch.exp(-root)


@dataclass(frozen=True)
class GaussianProcess:
    """A fitted Gaussian process with what it needs to be used and what it was made from.

    Attributes
    ----------
    exact : whether every training action is an inducing point, so that nothing is approximated.
    size : of the spread, set on held-out casts.
    """

    posterior: Posterior
    exact: bool
    actions: Normalisation
    endpoints: Normalisation
    dataset: str
    facts: Mapping[str, object]
    seed: int
    history: tuple[Epoch, ...]
    size: Spread

    def predict(self, actions: np.ndarray) -> np.ndarray:
        """Predict endpoints (n, 2) [m] of actions (n, 6)."""
        rows, posterior = self._inputs(actions), self.posterior
        if not self.exact:
            rows, posterior = rows.float(), posterior.single()
        return self.endpoints.undo(in_parts(posterior.mean, rows).numpy().astype(float))

    def spread(self, actions: np.ndarray) -> np.ndarray:
        """Return standard deviations (n, 2) [m] of a cast's endpoint about the prediction."""
        return self.size(self.doubt(actions), self.slopes(actions))

    def doubt(self, actions: np.ndarray) -> np.ndarray:
        """Return the normalised standard deviation of a cast of actions (n, 6), (n,)."""
        return in_parts(self.posterior.deviation, self._inputs(actions)).numpy()

    def slopes(self, actions: np.ndarray) -> np.ndarray:
        """Return the endpoint's derivatives (n, 2, 6) by the numbers of actions (n, 6)."""
        slopes = row_slopes(self.posterior.mean, self._inputs(actions)).numpy()
        return slopes * self.endpoints.scale[:, None] / self.actions.scale

    def save(self, folder: Path) -> None:
        """Write weights.safetensors, training.csv and, last, policy.yaml into `folder`."""
        told = {
            "kind": "exact Gaussian process" if self.exact else "sparse Gaussian process",
            "dataset": self.dataset,
            "seed": self.seed,
            "inducing_points": len(self.posterior.points),
            "examples": dict(self.facts),
            "spread": self.size.as_dict(),
            "normalisation": {
                "actions": self.actions.as_dict(),
                "endpoints_m": self.endpoints.as_dict(),
            },
        }
        write_model(folder, vars(self.posterior), told, self.history)

    @classmethod
    def load(cls, folder: Path) -> "GaussianProcess":
        """Read a process that `save` wrote."""
        stored = read_model(folder)
        told = stored.told
        return cls(
            Posterior(**stored.tensors),
            told["kind"].startswith("exact"),
            Normalisation.from_dict(told["normalisation"]["actions"]),
            Normalisation.from_dict(told["normalisation"]["endpoints_m"]),
            told["dataset"],
            told["examples"],
            told["seed"],
            stored.history,
            Spread.from_dict(told["spread"]),
        )

    def _inputs(self, actions: np.ndarray) -> torch.Tensor:
        return torch.from_numpy(self.actions.apply(actions))
