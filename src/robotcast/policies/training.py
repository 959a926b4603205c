"""The training loop of every forward model, and the mixture that brief trainings choose."""

import hashlib
import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
import torch
from torch import nn

from robotcast.files import atomic_file
from robotcast.policies.datasets import Dataset, Examples, folds, mixed_dataset
from robotcast.policies.forward_model import (
    Epoch,
    LearnedModel,
    Normalisation,
    Tensors,
    best_epoch,
    reproducible_torch,
)
from robotcast.processes.elsewhere import answers, cores
from robotcast.progress import Progress, silent
from robotcast.source import source_digest

_ROOM = "policies"
_KEPT_EVERY = 5  # passes between two states on disk
_FOLDS = 3
_LEAST_MISS_M = 1e-3  # a miss below what tracking can tell counts as this


class Fit(ABC):
    """A model in training: what moves, and what moves it."""

    module: nn.Module
    optimizer: torch.optim.Optimizer

    def __init__(self, dataset: Dataset, seed: int) -> None:
        self.actions = Normalisation.of(dataset.training.actions)
        self.endpoints = Normalisation.of(dataset.training.endpoints_m)
        self.shared: dict[str, Any] = {  # attributes of a `LearnedModel`
            "actions": self.actions,
            "endpoints": self.endpoints,
            "dataset": dataset.name,
            "facts": dataset.facts,
            "seed": seed,
        }

    def tensors(self, examples: Examples, precision: torch.dtype) -> tuple[torch.Tensor, ...]:
        """Return actions (n, 6) and endpoints (n, 2), normalised, and weights (n,)."""
        inputs = self.actions.apply(examples.actions)
        ends = self.endpoints.apply(examples.endpoints_m)
        columns = (inputs, ends, examples.weights)
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
class Learner(ABC):
    """One way to make a forward model: what conf/policy/*.yaml configures.

    There are `passes` over the examples at most, and `patience` without a better held-out loss;
    held-out misses beyond `outlier_m` count less and less when passes are compared.
    """

    name: ClassVar[str]
    kind: ClassVar[type[LearnedModel]]
    positive: ClassVar[tuple[str, ...]] = ("learning_rate", "outlier_m", "passes", "patience")
    learning_rate: float
    outlier_m: float
    passes: int
    patience: int

    def __post_init__(self) -> None:
        for name in self.positive:
            if (value := getattr(self, name)) <= 0:
                raise ValueError(f"policy {self.name}: {name} must be positive, got {value}")

    @abstractmethod
    def begin(self, dataset: Dataset, seed: int) -> Fit:
        """Return a model that is to be trained on `dataset.training`."""

    def fit(
        self,
        dataset: Dataset,
        *,
        seed: int,
        unfinished: Path | None = None,
        progress: Progress = silent,
    ) -> LearnedModel:
        """Train until the loss on `dataset.validation` stops falling; keep the best pass.

        The same dataset and seed give the same bytes. A training that was killed goes on from the
        file `unfinished`, which is removed at the end, and gives the same bytes too; None keeps
        none, and what another training left is not used.
        """
        with reproducible_torch(seed):
            fit, fingerprint = self.begin(dataset, seed), _fingerprint(dataset, self, seed)
            history, best = _resume(fit, unfinished, fingerprint)
            for number in range(len(history) + 1, self.passes + 1):
                if history and number - best_epoch(history).epoch > self.patience:
                    break
                training_loss = fit.one_pass(number)
                predicted_m = fit.predict(dataset.validation.actions)
                judged = held_out_loss(predicted_m, dataset.validation, self.outlier_m)
                history.append(Epoch(number, training_loss, *judged))
                if not best or best_epoch(history) is history[-1]:
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

    The loss is the weighted mean of Cauchy's function log(1 + (miss / outlier)²): the few
    whip-like casts, which no smooth function explains, must not decide which pass is the best.
    """
    misses_m = np.linalg.norm(predicted_m - held_out.endpoints_m, axis=1)
    costs = np.log1p((misses_m / outlier_m) ** 2)
    return float(np.average(costs, weights=held_out.weights)), float(np.median(misses_m))


def _fingerprint(dataset: Dataset, learner: Learner, seed: int) -> str:
    digest = hashlib.sha256(f"{dataset.name} {learner} {seed} {source_digest(_ROOM)}".encode())
    for part in (dataset.training, dataset.validation):
        for array in vars(part).values():
            digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def _keep(fit: Fit, path: Path, fingerprint: str, history: list[Epoch], best: Tensors) -> None:
    state = {
        "fingerprint": fingerprint,
        "history": [asdict(epoch) for epoch in history],
        "best": best,
        "module": fit.module.state_dict(),
        "optimizer": fit.optimizer.state_dict(),
    }
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


class Mixture(NamedTuple):
    """How to mix real and simulated casts: real part of the examples, weight of each in the loss.

    `held_out_miss_m` is the geometric mean of the misses on held-out real casts; None when not
    tried.
    """

    real_fraction: float
    real_weight: float
    held_out_miss_m: float | None = None


def choose_mixture(
    learner: Learner,
    real: Dataset,
    simulated: Dataset,
    *,
    fractions: Sequence[float],
    weights: Sequence[float],
    passes: int,
    seed: int,
    progress: Progress = silent,
) -> tuple[Mixture, ...]:
    """Try every pair of a fraction and a weight; return all, the best first.

    The paper takes "the best performing values" (paper, "Experiments"). Here forward models
    trained for so many `passes` are judged on casts that none of them saw, each real cast once
    (Stone 1974), and never on the targets that policies are tested on. The geometric mean of the
    misses counts: like the median it does not let the few whip-like casts decide, and it is less
    noisy where few casts are held out. Too few real actions tell nothing: then the pairs come as
    they were given.
    """
    pairs = [Mixture(*pair) for pair in product(fractions, weights)]
    if not pairs:
        raise ValueError("dataset mixed: real_fraction and real_weight need a value each")
    held_out = list(folds(real, _FOLDS, seed=seed))
    if len(pairs) == 1 or not held_out:
        return tuple(pairs)
    brief = learner.shortened(passes)
    trials = [(brief, seed, simulated, pair, *fold) for pair in pairs for fold in held_out]
    logarithms: dict[Mixture, list[np.ndarray]] = {pair: [] for pair in pairs}
    progress(0, len(trials))
    found = answers(_log_misses, trials, cores(0))  # a network this small keeps one core busy
    for done, ((_, _, _, pair, *_), misses) in enumerate(zip(trials, found, strict=True), 1):
        logarithms[pair].append(misses)
        note = f"tried {pair.real_fraction:.0%} real × {pair.real_weight:g}"
        progress(done, len(trials), note)
    means = {pair: float(np.concatenate(logarithms[pair]).mean()) for pair in pairs}
    ranked = sorted(pairs, key=means.__getitem__)
    return tuple(pair._replace(held_out_miss_m=float(np.exp(means[pair]))) for pair in ranked)


def _log_misses(
    trial: tuple[Learner, int, Dataset, Mixture, Dataset, Examples],
) -> np.ndarray:
    """Learn one mixture without a fold; return the logarithms of the misses on that fold, (n,)."""
    learner, seed, simulated, (fraction, weight, _), rest, held_out = trial
    mixed = mixed_dataset(rest, simulated, real_fraction=fraction, real_weight=weight, seed=seed)
    model = learner.fit(mixed, seed=seed)
    misses = np.linalg.norm(model.predict(held_out.actions) - held_out.endpoints_m, axis=1)
    return np.log(np.maximum(misses, _LEAST_MISS_M))
