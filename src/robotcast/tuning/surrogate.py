"""A Gaussian process of the losses seen so far, and where it expects better ones (BoTorch)."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import torch
from botorch.acquisition import AcquisitionFunction
from botorch.acquisition.analytic import (
    LogExpectedImprovement,
    LogProbabilityOfImprovement,
    UpperConfidenceBound,
)
from botorch.exceptions.errors import ModelFittingError
from botorch.fit import fit_gpytorch_mll
from botorch.models import SingleTaskGP
from botorch.models.utils.gpytorch_modules import get_covar_module_with_dim_scaled_prior
from botorch.optim import optimize_acqf
from botorch.utils.sampling import manual_seed
from gpytorch.mlls import ExactMarginalLogLikelihood

ACQUISITIONS = ("ei", "lcb", "mpi")


@dataclass(frozen=True)
class Acquisition:
    """What makes a vector promising (see `BayesianOptimization`)."""

    name: str
    improvement: float
    exploration: float

    def of(self, model: SingleTaskGP, best: float) -> AcquisitionFunction:
        """Return the function to climb, of a model of gains whose largest so far is `best`.

        The two improvements are climbed by their logarithms, whose slopes do not vanish where
        there is little to expect (Ament et al. 2023).
        """
        if self.name == "ei":
            return LogExpectedImprovement(model, best + self.improvement)
        if self.name == "mpi":
            return LogProbabilityOfImprovement(model, best + self.improvement)
        # the lower confidence bound of the loss is the upper one of the gain
        return UpperConfidenceBound(model, self.exploration**2)


def most_promising(
    vectors: np.ndarray,
    loss: np.ndarray,
    acquisition: Acquisition,
    *,
    wanted: int,
    raw_samples: int,
    restarts: int,
    seed: int,
) -> np.ndarray:
    """Return the next vectors to try, (wanted, n).

    They are chosen one after the other, each as if those before it had turned out as the model
    expects: what is left uncertain moves the next elsewhere (kriging believer, Ginsbourger et
    al. 2010).

    Parameters
    ----------
    vectors : ndarray of shape (n_vectors, n), those tried so far, in [0, 1].
    loss : ndarray of shape (n_vectors,), what they cost.
    """
    spread = loss.std(ddof=1) or 1.0
    gain = torch.tensor((loss.mean() - loss) / spread)
    tried = torch.tensor(vectors, dtype=torch.float64)
    bounds = torch.tensor([[0.0] * tried.shape[1], [1.0] * tried.shape[1]], dtype=torch.float64)
    with _one_thread(), manual_seed(seed):
        model = _fitted(tried, gain)
        for _ in range(wanted):
            candidate, _ = optimize_acqf(
                acquisition.of(model, float(gain.max())),
                bounds=bounds,
                q=1,
                num_restarts=restarts,
                raw_samples=raw_samples,
            )
            with torch.no_grad():
                believed = model.posterior(candidate).mean.flatten()
            tried, gain = torch.cat([tried, candidate]), torch.cat([gain, believed])
            model.set_train_data(tried, gain, strict=False)
    return np.clip(tried[-wanted:].numpy(), 0.0, 1.0)


def _fitted(tried: torch.Tensor, gain: torch.Tensor) -> SingleTaskGP:
    """Return a Gaussian process with a Matérn 5/2 kernel and noise, fitted to gains (n,).

    Its lengths have the priors of Hvarfner et al. 2024. The gains are standardised already.
    """
    kernel = get_covar_module_with_dim_scaled_prior(
        ard_num_dims=tried.shape[1], use_rbf_kernel=False
    )
    model = SingleTaskGP(tried, gain[:, None], covar_module=kernel, outcome_transform=None)
    try:
        fit_gpytorch_mll(ExactMarginalLogLikelihood(model.likelihood, model))
    except ModelFittingError:
        # the priors' modes are a usable model; a night's tuning must not end over one fit
        model.eval()
    return model


@contextmanager
def _one_thread() -> Iterator[None]:
    """Let torch add in one order: the same seed gives the same vectors on any machine's cores."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
