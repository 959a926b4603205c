"""A Gaussian process as forward model (paper, "Baseline Policies"), exact or sparse.

It is trained by the variational bound of Titsias (2009), with GPyTorch's kernels. With every
training action among the inducing points the bound is the exact marginal likelihood, so the exact
process and the sparse one are one code.
"""

import math
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import torch
from gpytorch.kernels import MaternKernel, ScaleKernel
from linear_operator.utils.cholesky import psd_safe_cholesky
from torch import nn
from torch.nn.functional import softplus

from robotcast.policies.datasets import Dataset
from robotcast.policies.forward_model import Epoch, LearnedModel, Tensors
from robotcast.policies.training import Fit, Learner

_JITTER = 1e-6
_LEAST_NOISE = 1e-4  # normalised variance of a cast: 1 % of the endpoints' spread
_FIRST_LENGTH, _FIRST_NOISE = 1.5, 0.05
_STEPS_A_PASS = 4  # judging the held-out casts costs half as much as a step


@dataclass(frozen=True, kw_only=True)
class GaussianProcess(LearnedModel):
    """A fitted process with a Matérn 5/2 kernel, in normalised units; x and y share the kernel.

    In double precision, because where casts hardly scatter, the mean of an exact process is a
    small difference of large numbers.
    """

    precision = torch.float64
    exact: bool  # whether every training action is among the points
    points: torch.Tensor  # (m, d)
    lengths: torch.Tensor  # (d,), of the kernel
    variance: torch.Tensor  # (), of the function
    noise: torch.Tensor  # (), of one cast
    mean_weights: torch.Tensor  # (m, 2); the mean is k(a, points) @ mean_weights
    known: torch.Tensor  # (m, m), V; the variance is k(a, a) − kᵀ V k

    def predict(self, actions: np.ndarray) -> np.ndarray:
        mean = self.mean if self.exact else partial(self.mean, precision=torch.float32)  # faster
        return self.endpoints.undo(self._apply(mean, actions))

    def mean(self, rows: torch.Tensor, precision: torch.dtype = torch.float64) -> torch.Tensor:
        parts = rows, self.points, self.lengths, self.variance, self.mean_weights
        rows, points, lengths, variance, weights = (part.to(precision) for part in parts)
        return variance * matern(rows, points, lengths) @ weights

    def deviation(self, rows: torch.Tensor) -> torch.Tensor:
        """Return the standard deviation (n,) of one cast at normalised actions (n, d)."""
        kernel = self.variance * matern(rows, self.points, self.lengths)
        left = self.variance - ((kernel @ self.known) * kernel).sum(dim=1)
        return torch.sqrt(left.clamp_min(0.0) + self.noise)

    def stored(self) -> tuple[dict[str, Any], Tensors]:
        kind = f"{'exact' if self.exact else 'sparse'} Gaussian process"
        tensors = {n: value for n, value in vars(self).items() if isinstance(value, torch.Tensor)}
        return {"kind": kind, "inducing_points": len(self.points)}, tensors

    @classmethod
    def restored(cls, settings: Any, tensors: Tensors, **shared: Any) -> "GaussianProcess":
        return cls(exact=settings["kind"].startswith("exact"), **tensors, **shared)


def matern(rows: torch.Tensor, points: torch.Tensor, lengths: torch.Tensor) -> torch.Tensor:
    """Return the Matérn 5/2 correlation (n, m) of rows (n, d) with points (m, d).

    Expanded by hand: twice as fast as the library's over the 67 500 candidates.
    """
    one, other = rows / lengths, points / lengths
    squares = one.square().sum(dim=1, keepdim=True) + other.square().sum(dim=1)
    apart = (squares - 2 * one @ other.T).clamp_min(1e-30).mul(5.0)
    root = apart.sqrt()
    return (1 + root + apart / 3) * torch.exp(-root)


class _ProcessFit(Fit):
    def __init__(self, learner: Any, dataset: Dataset, seed: int) -> None:
        super().__init__(dataset, seed)
        self.examples = self.tensors(dataset.training.merged(), torch.float64)
        points = torch.unique(self.examples[0], dim=0)
        self.exact = len(points) <= learner.exact_up_to
        if not self.exact:
            rng = np.random.default_rng((seed, 3))
            drawn = rng.permutation(len(points))[: learner.inducing]
            points = points[torch.from_numpy(np.sort(drawn))]
        self.module = self.process = _Process(points, moving=not self.exact)
        moved = [p for p in self.process.parameters() if p.requires_grad]
        self.optimizer = torch.optim.Adam(moved, lr=learner.learning_rate)

    def one_pass(self, number: int) -> float:
        loss = torch.zeros(())
        for _ in range(_STEPS_A_PASS):
            self.optimizer.zero_grad(set_to_none=True)
            loss = -self.process.bound(*self.examples)
            loss.backward()
            self.optimizer.step()
        return loss.item()

    def predict(self, actions: np.ndarray) -> np.ndarray:
        return self.model(()).predict(actions)

    def model(self, history: tuple[Epoch, ...]) -> GaussianProcess:
        tensors = self.process.posterior(*self.examples)
        return GaussianProcess(exact=self.exact, history=history, **tensors, **self.shared)


@dataclass(frozen=True, kw_only=True)
class GaussianProcessLearner(Learner):
    """Fits a process, exact up to so many training actions, sparse beyond.

    A pass is four steps of Adam on the bound of all examples; the `inducing` points of a sparse
    process move with them.
    """

    name, kind, begin = "gp", GaussianProcess, _ProcessFit
    positive = ("exact_up_to", "inducing", *Learner.positive)
    exact_up_to: int
    inducing: int

    def shortened(self, passes: int) -> "GaussianProcessLearner":
        """Full steps come near their end long before mini-batches do: a quarter is enough."""
        return super().shortened(math.ceil(passes / 4))


class _Process(nn.Module):
    """Kernel, noise and inducing points; of actions (n, 6), endpoints (n, 2), weights (n,)."""

    def __init__(self, points: torch.Tensor, *, moving: bool) -> None:
        super().__init__()
        base = MaternKernel(nu=2.5, ard_num_dims=points.shape[1])
        base.initialize(lengthscale=_FIRST_LENGTH)
        self.kernel = ScaleKernel(base).double()
        self.points = nn.Parameter(points.clone(), requires_grad=moving)
        self.raw_noise = nn.Parameter(torch.tensor(np.log(np.expm1(_FIRST_NOISE))))

    @property
    def noise(self) -> torch.Tensor:
        """Variance of one cast about the function, ()."""
        return softplus(self.raw_noise) + _LEAST_NOISE

    def bound(self, *examples: torch.Tensor) -> torch.Tensor:
        """Return the lower bound of the log likelihood per unit of weight, ()."""
        actions, ends, weights = examples
        _, whitened, inner, projected = self._factors(*examples)
        outputs, noise = ends.shape[1], self.noise
        spent = (weights[:, None] * ends.square()).sum() / noise
        prior = torch.as_tensor(self.kernel(actions, diag=True))
        missed = prior - whitened.square().sum(dim=0)
        return (
            -0.5 * outputs * weights.sum() * torch.log(2 * torch.pi * noise)
            - outputs * inner.diagonal().log().sum()
            - 0.5 * (spent - projected.square().sum())
            - 0.5 * outputs * (weights * missed).sum() / noise
        ) / weights.sum()

    @torch.no_grad()
    def posterior(self, *examples: torch.Tensor) -> Tensors:
        """Return the tensors of `GaussianProcess` after the examples."""
        prior, _, inner, projected = self._factors(*examples)
        both = prior @ inner
        unit = torch.eye(len(both), dtype=both.dtype)
        from_prior = torch.linalg.solve_triangular(prior, unit, upper=False)
        from_both = torch.linalg.solve_triangular(both, unit, upper=False)
        weights = torch.linalg.solve_triangular(both.T, projected, upper=True)
        return {
            "points": self.points.detach().clone(),
            "lengths": self.kernel.base_kernel.lengthscale.detach()[0].clone(),
            "variance": self.kernel.outputscale.detach().clone(),
            "noise": self.noise.detach().clone(),
            "mean_weights": weights.contiguous(),  # row-major, as a file holds it
            "known": from_prior.T @ from_prior - from_both.T @ from_both,
        }

    def _factors(self, *examples: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """Return what the bound and the posterior share, of weights w, endpoints y and noise σ².

        L (m, m), the Cholesky factor of the points' kernel; L⁻¹ k(points, actions) (m, n) with
        columns a; the factor of B = I + Σ w a aᵀ / σ²; its inverse times Σ w a y / σ² (m, 2).
        """
        actions, ends, weights = examples
        own = self.kernel(self.points).to_dense()
        unit = torch.eye(len(own), dtype=own.dtype)
        prior = psd_safe_cholesky(own + _JITTER * self.kernel.outputscale * unit)
        across = self.kernel(self.points, actions).to_dense()
        whitened = torch.linalg.solve_triangular(prior, across, upper=False)
        heavy = whitened * (weights / self.noise)
        inner = psd_safe_cholesky(heavy @ whitened.T + unit)
        projected = torch.linalg.solve_triangular(inner, heavy @ ends, upper=False)
        return prior, whitened, inner, projected
