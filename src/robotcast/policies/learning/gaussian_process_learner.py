"""Training of Gaussian processes by the variational bound of Titsias (2009), with GPyTorch.

With every training action among the inducing points the bound is the exact marginal
likelihood, so the exact process and the sparse one are one code.
"""

import math
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
import torch
from gpytorch.kernels import MaternKernel, ScaleKernel
from linear_operator.utils.cholesky import psd_safe_cholesky
from torch import nn
from torch.nn.functional import softplus

from robotcast.policies.learning.datasets import Dataset
from robotcast.policies.learning.gaussian_process import GaussianProcess, Posterior
from robotcast.policies.learning.judging import Held
from robotcast.policies.learning.normalisation import Normalisation
from robotcast.policies.learning.reproducible import in_parts, reproducible_torch
from robotcast.policies.learning.rows import Rows
from robotcast.policies.learning.spread import Spread, sized
from robotcast.policies.learning.training import subject_of, train
from robotcast.progress import Progress, silent

_JITTER = 1e-6
_LEAST_NOISE = 1e-4  # normalised variance of a cast: 1 % of the endpoints' spread
_FIRST_LENGTH, _FIRST_NOISE = 1.5, 0.05
_STEPS_A_PASS = 4  # judging the held-out casts costs half as much as a step


@dataclass(frozen=True)
class GaussianProcessLearner:
    """Fits a Gaussian process: exact while the actions are few, sparse beyond.

    Attributes
    ----------
    exact_up_to : training actions up to which the process is exact.
    inducing : inducing points of a sparse process; they move while it is trained.
    outlier_m : held-out misses beyond it count less and less when the best step is chosen.
    passes : at most so many times four steps of Adam on the bound of all training examples.
    patience : passes without a better held-out loss before it stops.
    """

    exact_up_to: int
    inducing: int
    learning_rate: float
    outlier_m: float
    passes: int
    patience: int

    def __post_init__(self) -> None:
        for field in fields(self):
            if getattr(self, field.name) <= 0:
                value = getattr(self, field.name)
                raise ValueError(f"policy gp: {field.name} must be positive, got {value}")

    def fit(
        self,
        dataset: Dataset,
        *,
        seed: int,
        unfinished: Path | None = None,
        progress: Progress = silent,
    ) -> GaussianProcess:
        """Raise the bound of `dataset.training`, keep the step best on `dataset.validation`."""
        examples = dataset.training.merged()
        actions = Normalisation.of(dataset.training.actions)
        endpoints = Normalisation.of(dataset.training.endpoints_m)
        rows = Rows.of(examples, actions, endpoints, torch.float64)
        held = Held(dataset.validation, actions, endpoints, self.outlier_m)
        points, exact = self._points(rows.actions, seed)
        with reproducible_torch(seed):
            process = _Process(points, moving=not exact)
            adam = torch.optim.Adam(
                [p for p in process.parameters() if p.requires_grad], lr=self.learning_rate
            )
            history = train(
                _ProcessFit(process, adam, rows, held),
                passes=self.passes,
                patience=self.patience,
                unfinished=unfinished,
                subject=subject_of(dataset, self, seed),
                progress=progress,
            )
            posterior = process.posterior(rows)
        fitted = GaussianProcess(
            posterior,
            exact,
            actions,
            endpoints,
            dataset.name,
            dataset.facts,
            seed,
            history,
            Spread.plain(actions.mean.size),
        )
        return replace(fitted, size=sized(fitted, dataset.calibration, actions.scale))

    def shortened(self, passes: int) -> "GaussianProcessLearner":
        """Return a learner of fewer passes, to try settings with.

        Full steps come near their end long before mini-batches do: a quarter is enough.
        """
        return replace(self, passes=min(math.ceil(passes / 4), self.passes))

    def load(self, folder: Path) -> GaussianProcess:
        """Read a process that `GaussianProcess.save` wrote."""
        return GaussianProcess.load(folder)

    def _points(self, actions: torch.Tensor, seed: int) -> tuple[torch.Tensor, bool]:
        """Return the first inducing points and whether they are all distinct actions."""
        distinct = torch.unique(actions, dim=0)
        if len(distinct) <= self.exact_up_to:
            return distinct, True
        rng = np.random.default_rng(np.random.SeedSequence((seed, 3)))
        drawn = rng.permutation(len(distinct))[: self.inducing]
        return distinct[torch.from_numpy(np.sort(drawn))], False


@dataclass(frozen=True)
class _Factors:
    """Cholesky factors that the bound and the posterior share.

    Attributes
    ----------
    points : (m, m), L of the kernel of the inducing points, with jitter.
    whitened : (m, n), L⁻¹ k(points, actions).
    inner : (m, m), factor of B = I + Σᵢ wᵢ aᵢ aᵢᵀ / σ² for columns aᵢ of `whitened`.
    told : (m, 2), inner⁻¹ Σᵢ wᵢ aᵢ yᵢ / σ².
    """

    points: torch.Tensor
    whitened: torch.Tensor
    inner: torch.Tensor
    told: torch.Tensor


class _Process(nn.Module):
    """Kernel, noise and inducing points: what training moves."""

    def __init__(self, points: torch.Tensor, *, moving: bool) -> None:
        super().__init__()
        base = MaternKernel(nu=2.5, ard_num_dims=points.shape[1])
        base.initialize(lengthscale=_FIRST_LENGTH)
        self.kernel = ScaleKernel(base).double()
        self.points = nn.Parameter(points.clone(), requires_grad=moving)
        start = np.log(np.expm1(_FIRST_NOISE))
        self.raw_noise = nn.Parameter(torch.tensor(start, dtype=torch.float64))

    @property
    def noise(self) -> torch.Tensor:
        """Variance of one cast about the function, ()."""
        return softplus(self.raw_noise) + _LEAST_NOISE

    def bound(self, rows: Rows) -> torch.Tensor:
        """Return the lower bound of the log likelihood per unit of weight, ()."""
        factors, weights, noise = self._factors(rows), rows.weights, self.noise
        outputs = rows.endpoints.shape[1]
        spent = (weights[:, None] * rows.endpoints.square()).sum() / noise
        prior = torch.as_tensor(self.kernel(rows.actions, diag=True))
        missed = prior - factors.whitened.square().sum(dim=0)
        return (
            -0.5 * outputs * weights.sum() * torch.log(2 * torch.pi * noise)
            - outputs * factors.inner.diagonal().log().sum()
            - 0.5 * (spent - factors.told.square().sum())
            - 0.5 * outputs * (weights * missed).sum() / noise
        ) / weights.sum()

    def posterior(self, rows: Rows) -> Posterior:
        """Return what is believed after the examples `rows`."""
        with torch.no_grad():
            factors = self._factors(rows)
            both = factors.points @ factors.inner
            unit = torch.eye(len(both), dtype=both.dtype)
            from_prior = torch.linalg.solve_triangular(factors.points, unit, upper=False)
            from_both = torch.linalg.solve_triangular(both, unit, upper=False)
            kernel = self.kernel.base_kernel
            weights = torch.linalg.solve_triangular(both.T, factors.told, upper=True)
            return Posterior(
                points=self.points.detach().clone(),
                lengths=kernel.lengthscale.detach()[0].clone(),
                variance=self.kernel.outputscale.detach().clone(),
                noise=self.noise.detach().clone(),
                mean_weights=weights.contiguous(),  # row-major, as a file holds it
                known=from_prior.T @ from_prior - from_both.T @ from_both,
            )

    def _factors(self, rows: Rows) -> _Factors:
        own = self.kernel(self.points).to_dense()
        own = own + _JITTER * self.kernel.outputscale * torch.eye(len(own), dtype=own.dtype)
        points = psd_safe_cholesky(own)
        across = self.kernel(self.points, rows.actions).to_dense()
        whitened = torch.linalg.solve_triangular(points, across, upper=False)
        heavy = whitened * (rows.weights / self.noise)
        inner = psd_safe_cholesky(heavy @ whitened.T + torch.eye(len(own), dtype=own.dtype))
        told = torch.linalg.solve_triangular(inner, heavy @ rows.endpoints, upper=False)
        return _Factors(points, whitened, inner, told)


@dataclass(frozen=True)
class _ProcessFit:
    """The process in training: a pass is a few steps, each on all examples."""

    module: _Process
    optimizer: torch.optim.Optimizer
    rows: Rows
    held: Held

    def one_pass(self, number: int) -> float:
        """Take some steps; return the negative bound before the last of them."""
        value = 0.0
        for _ in range(_STEPS_A_PASS):
            self.optimizer.zero_grad(set_to_none=True)
            loss = -self.module.bound(self.rows)
            loss.backward()
            self.optimizer.step()
            value = loss.item()
        return value

    def judge(self) -> tuple[float, float]:
        """Return the loss on the held-out casts and the median miss there [m]."""
        mean = self.module.posterior(self.rows).mean
        return self.held.judge(lambda inputs: in_parts(mean, torch.from_numpy(inputs)).numpy())
