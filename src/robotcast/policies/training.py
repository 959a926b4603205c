"""The training loop of every forward model: early stopping, and going on after a kill."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import torch
from torch import nn

from robotcast.files import atomic_file, digest, source_digest
from robotcast.policies.datasets import Dataset, Examples
from robotcast.policies.forward_model import (
    Epoch,
    LearnedModel,
    Normalisation,
    Tensors,
    best_epoch,
    reproducible_torch,
)
from robotcast.running import Progress, silent

_KEPT_EVERY = 5  # passes between two states on disk


class Fit(ABC):
    """A model in training: what moves, and what moves it."""

    module: nn.Module
    optimizer: torch.optim.Optimizer

    def __init__(self, dataset: Dataset, seed: int) -> None:
        self.actions = Normalisation.of(dataset.training.actions)
        self.endpoints = Normalisation.of(dataset.training.endpoints_m)
        self.shared: dict[str, Any] = {"actions": self.actions, "endpoints": self.endpoints}
        self.shared |= {"dataset": dataset.name, "facts": dataset.facts, "seed": seed}

    def tensors(self, examples: Examples, precision: torch.dtype) -> tuple[torch.Tensor, ...]:
        """Return actions (n, 6) and endpoints (n, 2), normalised, and weights (n,)."""
        inputs = self.actions.apply(examples.actions)
        columns = (inputs, self.endpoints.apply(examples.endpoints_m), examples.weights)
        return tuple(torch.from_numpy(np.ascontiguousarray(c)).to(precision) for c in columns)

    @abstractmethod
    def one_pass(self, number: int) -> float:
        """Improve the module by pass `number`, counted from 1; return the loss on the way.

        What it does must follow from the number and the state alone.
        """

    @abstractmethod
    def predict(self, actions: np.ndarray) -> np.ndarray:
        """Predict endpoints (n, 2) [m] of actions (n, 6) by what was learned so far."""

    @abstractmethod
    def model(self, history: tuple[Epoch, ...]) -> LearnedModel:
        """Return what was learned."""


@dataclass(frozen=True, kw_only=True)
class Learner:
    """One way to make a forward model: what conf/policy/*.yaml configures."""

    name: ClassVar[str]
    kind: ClassVar[type[LearnedModel]]
    begin: ClassVar[Callable[..., Fit]]  # (learner, dataset, seed) → a model to be trained
    positive: ClassVar[tuple[str, ...]] = ("learning_rate", "outlier_m", "passes", "patience")
    learning_rate: float
    outlier_m: float  # held-out misses beyond it count less and less when passes are compared
    passes: int  # over the examples, at most
    patience: int  # passes without a better held-out loss

    def __post_init__(self) -> None:
        for name in self.positive:
            if (value := getattr(self, name)) <= 0:
                raise ValueError(f"policy {self.name}: {name} must be positive, got {value}")

    def fit(
        self,
        dataset: Dataset,
        *,
        seed: int,
        unfinished: Path | None = None,
        progress: Progress = silent,
    ) -> LearnedModel:
        """Train until the loss on `dataset.validation` stops falling; keep the best pass.

        The same dataset and seed give the same bytes, also when a training that was killed goes on
        from the file `unfinished`, which is removed at the end. What another left is not used.
        """
        with reproducible_torch(seed):
            fit = type(self).begin(self, dataset, seed)
            fingerprint = _fingerprint(dataset, self, seed)
            history, best = _resume(fit, unfinished, fingerprint)
            for number in range(len(history) + 1, self.passes + 1):
                if history and number - best_epoch(history).epoch > self.patience:
                    break
                training_loss = fit.one_pass(number)
                predicted_m = fit.predict(dataset.validation.actions)
                judged = held_out_loss(predicted_m, dataset.validation, self.outlier_m)
                history.append(Epoch(number, training_loss, *judged))
                if best_epoch(history) is history[-1]:
                    best = {name: v.detach().clone() for name, v in fit.module.state_dict().items()}
                median_mm = 1000 * best_epoch(history).validation_median_m
                progress(number, self.passes, f"median {median_mm:.1f} mm")
                if unfinished is not None and number % _KEPT_EVERY == 0:
                    _keep(fit, unfinished, fingerprint, history, best)
            if not math.isfinite(best_epoch(history).validation_loss):
                raise ValueError("training diverged from the first pass: lower the learning rate")
            fit.module.load_state_dict(best)
            if unfinished is not None:
                unfinished.unlink(missing_ok=True)
            model = fit.model(tuple(history))
        return model.calibrated(dataset.calibration)

    def shortened(self, passes: int) -> Self:
        """Return a learner of fewer passes, to try settings with."""
        return replace(self, passes=min(passes, self.passes))

    def load(self, folder: Path) -> LearnedModel:
        """Read back what `LearnedModel.save` wrote."""
        return self.kind.load(folder)


def held_out_loss(
    predicted_m: np.ndarray, held_out: Examples, outlier_m: float
) -> tuple[float, float]:
    """Return the loss by which passes are compared, and the median miss [m].

    It is the weighted mean of Cauchy's function log(1 + (miss / outlier)²): the few whip-like
    casts, which no smooth function explains, must not decide which pass is the best.
    """
    misses_m = np.linalg.norm(predicted_m - held_out.endpoints_m, axis=1)
    costs = np.log1p((misses_m / outlier_m) ** 2)
    return float(np.average(costs, weights=held_out.weights)), float(np.median(misses_m))


def _fingerprint(dataset: Dataset, learner: Learner, seed: int) -> str:
    arrays = [a for part in (dataset.training, dataset.validation) for a in vars(part).values()]
    return digest(f"{dataset.name} {learner} {seed} {source_digest('policies')}", *arrays)


def _keep(fit: Fit, path: Path, fingerprint: str, history: list[Epoch], best: Tensors) -> None:
    state = {"fingerprint": fingerprint, "history": [vars(e) for e in history], "best": best}
    state |= {"module": fit.module.state_dict(), "optimizer": fit.optimizer.state_dict()}
    with atomic_file(path) as temporary:
        torch.save(state, temporary)


def _resume(fit: Fit, path: Path | None, fingerprint: str) -> tuple[list[Epoch], Tensors]:
    """Put `fit` where a killed training of the same fingerprint was; return its past."""
    if path is None or not path.exists():
        return [], {}
    state = torch.load(path, weights_only=True)
    if state["fingerprint"] != fingerprint:
        return [], {}
    fit.module.load_state_dict(state["module"])
    fit.optimizer.load_state_dict(state["optimizer"])
    return [Epoch(**epoch) for epoch in state["history"]], state["best"]
