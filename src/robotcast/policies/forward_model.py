"""What every forward model answers (paper, "Policies"), and what learned ones share.

On disk a model is a folder: numbers as safetensors, the rest as YAML and CSV, no pickles.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any, ClassVar, Protocol, Self

import numpy as np
import polars as pl
import torch
import yaml
from safetensors.torch import load_file, save_file

from robotcast.files import atomic_file, digest, write_text, write_yaml
from robotcast.policies.datasets import Examples

WEIGHTS_FILE, HISTORY_FILE, DESCRIPTION_FILE = "weights.safetensors", "training.csv", "policy.yaml"
ROWS_AT_ONCE = 1024  # what one core works on at a time: its intermediate results stay in cache
_TINY = 1e-12
_WITHIN = 0.6827  # part of a normal distribution within one standard deviation
_DOUBT_POWERS = np.linspace(0.0, 1.0, 5)  # that are tried
_SLOPE_POWERS = np.linspace(0.0, 1.25, 6)
_PRIOR_MEAN, _PRIOR_DEVIATION = 0.5, 0.5  # of both powers

Tensors = dict[str, torch.Tensor]
TensorFunction = Callable[[torch.Tensor], torch.Tensor]


@dataclass(frozen=True)
class Epoch:
    """How one pass over the training examples ended."""

    epoch: int
    training_loss: float
    validation_loss: float
    validation_median_m: float


def best_epoch(history: Sequence[Epoch]) -> Epoch:
    """Return the pass with the lowest loss on held-out casts, the first of equals."""
    return min(history, key=lambda e: (math.isnan(e.validation_loss), e.validation_loss))


class ForwardModel(Protocol):
    """f_forw, of actions (n, 6) in the order and units of `ACTION_COLUMNS`."""

    @property
    def facts(self) -> Mapping[str, object]:
        """What is known of the examples; `cable` names the cable they are of, where known."""
        ...

    def predict(self, actions: np.ndarray) -> np.ndarray:
        """Return where casts come to rest, (n, 2), in the robot base's frame [m]."""
        ...

    def spread(self, actions: np.ndarray) -> np.ndarray:
        """Return standard deviations (n, 2) [m] of a cast's endpoint about the prediction."""
        ...

    def slopes(self, actions: np.ndarray) -> np.ndarray:
        """Return the endpoint's derivatives (n, 2, 6) by the numbers of the actions."""
        ...


@dataclass(frozen=True)
class Normalisation:
    """Shift and scale, both (d,), that bring columns to mean 0 and spread 1."""

    mean: np.ndarray
    scale: np.ndarray

    @classmethod
    def of(cls, values: np.ndarray) -> "Normalisation":
        """Compute from values (n, d); a column that never changes keeps scale 1."""
        spread = values.std(axis=0)
        return cls(values.mean(axis=0), np.where(spread > 1e-9, spread, 1.0))

    def apply(self, values: np.ndarray) -> np.ndarray:
        return (values - self.mean) / self.scale

    def undo(self, normalised: np.ndarray) -> np.ndarray:
        return normalised * self.scale + self.mean


def slope_size(slopes: np.ndarray, unit: np.ndarray) -> np.ndarray:
    """Return |S| (n,) [m] of slopes (n, 2, d) for actions in units of `unit` (d,)."""
    return np.linalg.norm(slopes * unit, axis=(1, 2))


def held_out_scale(misses_m: np.ndarray, relative: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the spread [m] that a relative spread of 1 means, for x and y, (2,).

    So that 68 % of the held-out casts, by `weights` (n,), have `misses_m` (n, 2) below their
    spread, `relative` (n,) of which is what the model expects. The quantile is the next larger
    one that n casts have (Vovk et al. 2005): few make a model say too much, not too little.
    """
    ratios = np.abs(misses_m) / relative[:, None]
    wanted = min(1.0, _WITHIN * (1 + 1 / len(ratios))) - 1e-12
    return np.quantile(ratios, wanted, axis=0, weights=weights, method="inverted_cdf")


@dataclass(frozen=True)
class Spread:
    """Standard deviations scale · d^p |S|^q of an endpoint, for a doubt d and a slope S.

    A model doubts where its examples scattered or were few. And wherever the endpoint moves far
    with the action, S = ∂endpoint/∂action, a model that is a little wrong, and chance in the arm,
    the cable and the board, move it far too: how far a cast ends from its prediction follows the
    slope more than the doubt, above all of a network that learned from few casts.
    """

    unit: np.ndarray  # (d,), in which S takes the numbers of an action
    powers: np.ndarray  # p and q
    least: np.ndarray  # doubt and slope [m] of the casts it was set on: nothing calmer is believed
    scale: np.ndarray  # (2,), for x and y

    def __call__(self, doubt: np.ndarray, slopes: np.ndarray) -> np.ndarray:
        """Return standard deviations (n, 2) [m] of a model's doubt (n,) and slopes (n, 2, d)."""
        return self._relative(doubt, slope_size(slopes, self.unit))[:, None] * self.scale

    def _relative(self, doubt: np.ndarray, slope_m: np.ndarray) -> np.ndarray:
        (p, q), (least, least_m) = self.powers, self.least
        return np.maximum(doubt, least) ** p * np.maximum(slope_m, least_m) ** q

    @classmethod
    def of(
        cls,
        misses_m: np.ndarray,
        doubt: np.ndarray,
        slopes: np.ndarray,
        unit: np.ndarray,
        weights: np.ndarray,
    ) -> "Spread":
        """Set a spread on held-out casts with `misses_m` (n, 2) and `weights` (n,).

        The powers make Laplace's likelihood largest; few casts move them little from a half each.
        """
        part = weights / weights.sum()
        slope_m, sizes_m = slope_size(slopes, unit), np.linalg.norm(misses_m, axis=1)
        least = np.maximum([doubt.min(), slope_m.min()], _TINY)

        def relative(powers: tuple[float, float]) -> np.ndarray:
            return cls(unit, np.array(powers), least, np.ones(2))._relative(doubt, slope_m)

        def loss(powers: tuple[float, float]) -> float:
            found = relative(powers)
            level = max(float(part @ (sizes_m / found)), _TINY)
            misfit = 2 * float(part @ np.log(found) + np.log(level))
            prior = sum((p - _PRIOR_MEAN) ** 2 for p in powers) / (2 * _PRIOR_DEVIATION**2)
            return len(part) * misfit + prior

        powers = min(product(_DOUBT_POWERS.tolist(), _SLOPE_POWERS.tolist()), key=loss)
        scale = held_out_scale(misses_m, relative(powers), weights)
        return cls(unit, np.array(powers), least, scale)


DOUBT_ALONE = Spread(np.ones(1), np.array([1.0, 0.0]), np.array([0.0, 1.0]), np.ones(2))


@dataclass(frozen=True, kw_only=True)
class LearnedModel(ABC):
    """A network or a Gaussian process in normalised units."""

    precision: ClassVar[torch.dtype]
    actions: Normalisation  # of the training examples, as of the endpoints
    endpoints: Normalisation
    dataset: str
    facts: Mapping[str, object]
    seed: int
    history: tuple[Epoch, ...]  # one entry a pass, of which the best gave the weights
    size: Spread = DOUBT_ALONE  # set on held-out casts

    @abstractmethod
    def mean(self, rows: torch.Tensor) -> torch.Tensor:
        """Return normalised endpoints (n, 2) of normalised actions (n, d)."""

    @abstractmethod
    def deviation(self, rows: torch.Tensor) -> torch.Tensor:
        """Return how unsure the model is of normalised actions (n, d), (n,), up to a factor."""

    @abstractmethod
    def stored(self) -> tuple[dict[str, Any], Tensors]:
        """Return settings for policy.yaml, and the weights."""

    @classmethod
    @abstractmethod
    def restored(cls, settings: Any, tensors: Tensors, **shared: Any) -> Self:
        """Make the model of what `stored` returned and of the attributes that all share."""

    def predict(self, actions: np.ndarray) -> np.ndarray:
        return self.endpoints.undo(self._apply(self.mean, actions))

    def spread(self, actions: np.ndarray, slopes: np.ndarray | None = None) -> np.ndarray:
        """See `ForwardModel`; `slopes` where they are known already."""
        return self.size(self.doubt(actions), self.slopes(actions) if slopes is None else slopes)

    def doubt(self, actions: np.ndarray) -> np.ndarray:
        """Return how unsure the model itself is of actions (n, d), (n,), up to a factor."""
        return self._apply(self.deviation, actions)

    def slopes(self, actions: np.ndarray) -> np.ndarray:
        def of_rows(rows: torch.Tensor) -> torch.Tensor:
            with torch.inference_mode(False), torch.enable_grad():
                inputs = rows.detach().requires_grad_()
                ends = self.mean(inputs).sum(dim=0)
                grads = [torch.autograd.grad(e, inputs, retain_graph=True)[0] for e in ends]
            return torch.stack(grads, dim=1)

        return self._apply(of_rows, actions) * self.endpoints.scale[:, None] / self.actions.scale

    def _apply(self, function: TensorFunction, actions: np.ndarray) -> np.ndarray:
        """Apply a function to normalised actions part by part, on as many cores as torch has.

        Parts are always cut alike and each is worked out by one thread, so the result has the
        same bits whatever the number of cores. Threads: a choice takes a fraction of the second
        that processes would need to begin.
        """
        parts = torch.from_numpy(self.actions.apply(actions)).to(self.precision).split(ROWS_AT_ONCE)
        n, one = torch.get_num_threads(), torch.inference_mode()(function)
        with reproducible_torch(0), ThreadPoolExecutor(n, "", torch.set_num_threads, (1,)) as pool:
            return torch.cat(list(pool.map(one, parts))).numpy().astype(float)

    def calibrated(self, casts: Examples) -> Self:
        """Return the model with the spread that held-out `casts` show."""
        misses_m = casts.endpoints_m - self.predict(casts.actions)
        doubt, slopes = self.doubt(casts.actions), self.slopes(casts.actions)
        size = Spread.of(misses_m, doubt, slopes, self.actions.scale, casts.weights)
        return replace(self, size=size)

    def save(self, folder: Path) -> None:
        """Write weights.safetensors, training.csv and, last, policy.yaml into `folder`."""
        settings, tensors = self.stored()
        weights = folder / WEIGHTS_FILE
        with atomic_file(weights) as temporary:
            save_file({name: v.contiguous() for name, v in tensors.items()}, temporary)
        history = pl.DataFrame([vars(e) for e in self.history]).write_csv(float_precision=6)
        write_text(folder / HISTORY_FILE, history)
        best, actions, ends = best_epoch(self.history), self.actions, self.endpoints
        description = {
            **settings,
            "dataset": self.dataset,
            "seed": self.seed,
            "spread": _lists(self.size),
            "examples": dict(self.facts),
            "normalisation": {"actions": _lists(actions), "endpoints_m": _lists(ends)},
            "epochs": len(self.history),
            "best_epoch": best.epoch,
            "validation_median_m": round(best.validation_median_m, 6),
            "weights_sha256": digest(weights.read_bytes()),
        }
        write_yaml(folder / DESCRIPTION_FILE, description)

    @classmethod
    def load(cls, folder: Path) -> Self:
        """Read back what `save` wrote; refuse weights that are not of the description."""
        facts, path = read_description(folder), folder / WEIGHTS_FILE
        if digest(path.read_bytes()) != facts["weights_sha256"]:
            raise ValueError(f"{path} does not belong to {DESCRIPTION_FILE} beside it: train again")
        history = pl.read_csv(folder / HISTORY_FILE).iter_rows(named=True)
        return cls.restored(
            facts,
            load_file(path),
            actions=Normalisation(**_arrays(facts["normalisation"]["actions"])),
            endpoints=Normalisation(**_arrays(facts["normalisation"]["endpoints_m"])),
            dataset=facts["dataset"],
            facts=facts["examples"],
            seed=facts["seed"],
            history=tuple(Epoch(**row) for row in history),
            size=Spread(**_arrays(facts["spread"])),
        )


def read_description(folder: Path) -> dict[str, Any]:
    """Read policy.yaml, which is written last; say what to run where there is none."""
    description = folder / DESCRIPTION_FILE
    if not description.exists():
        raise FileNotFoundError(f"{description} is missing: run the train stage first")
    return yaml.safe_load(description.read_text(encoding="utf-8"))


def _lists(numbers: object) -> dict[str, Any]:
    return {name: value.tolist() for name, value in vars(numbers).items()}


def _arrays(numbers: Mapping[str, Any]) -> dict[str, np.ndarray]:
    return {name: np.array(value) for name, value in numbers.items()}


@contextmanager
def reproducible_torch(seed: int) -> Iterator[None]:
    """Make torch give the same bytes on any number of cores; its global state is put back.

    On one thread every sum on the CPU has one order; `torch.use_deterministic_algorithms` has
    nothing to add, and would import torch's compiler, which takes seconds.
    """
    threads = torch.get_num_threads()
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        torch.set_num_threads(1)
        try:
            yield
        finally:
            torch.set_num_threads(threads)
