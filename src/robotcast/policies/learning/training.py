"""One training loop for every forward model: early stopping, and going on after a kill."""

import hashlib
import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
import torch
from safetensors import safe_open
from safetensors.torch import save_file
from torch import nn

from robotcast.files import atomic_file
from robotcast.policies.learning.datasets import Dataset
from robotcast.progress import Progress, silent
from robotcast.source import source_digest

_ROOM = "policies/learning"
_KEPT_EVERY = 5  # passes between two states on disk


@dataclass(frozen=True)
class Epoch:
    """How one pass over the training examples ended."""

    epoch: int
    training_loss: float
    validation_loss: float
    validation_median_m: float


class Fit(Protocol):
    """A model in training. What a pass does must follow from its number and the state alone."""

    @property
    def module(self) -> nn.Module: ...

    @property
    def optimizer(self) -> torch.optim.Optimizer: ...

    def one_pass(self, number: int) -> float:
        """Improve the module by pass `number`, counted from 1; return the loss on the way."""
        ...

    def judge(self) -> tuple[float, float]:
        """Return the loss on the held-out casts and the median miss there [m]."""
        ...


def train(
    fit: Fit,
    *,
    passes: int,
    patience: int,
    unfinished: Path | None = None,
    subject: str = "",
    progress: Progress = silent,
) -> tuple[Epoch, ...]:
    """Train until the held-out loss has not fallen for `patience` passes; return all of them.

    The module is left with the parameters of the best pass. A training that was killed goes on
    from `unfinished` and ends with the same bytes as one that was not.

    Parameters
    ----------
    unfinished : file for the state in between, removed at the end; None keeps none.
    subject : text that names what is trained on what; a file of something else is not used.
    """
    history, best = _resume(fit, unfinished, subject)
    for number in range(len(history) + 1, passes + 1):
        if history and number - _best(history).epoch > patience:
            break
        training_loss = fit.one_pass(number)
        history.append(Epoch(number, training_loss, *fit.judge()))
        if not best or _best(history) is history[-1]:
            best = {name: v.detach().clone() for name, v in fit.module.state_dict().items()}
        note = f"median {1000 * _best(history).validation_median_m:.1f} mm"
        progress(number, passes, note)
        if unfinished is not None and number % _KEPT_EVERY == 0:
            _keep(fit, unfinished, subject, history, best)
    if not math.isfinite(_best(history).validation_loss):
        raise ValueError("training diverged from the first pass: lower the learning rate")
    fit.module.load_state_dict(best)
    if unfinished is not None:
        unfinished.unlink(missing_ok=True)
    return tuple(history)


def best_epoch(history: Sequence[Epoch]) -> Epoch:
    """Return the pass with the lowest loss on held-out casts, the first of equals."""
    return _best(history)


def subject_of(dataset: Dataset, settings: object, seed: int) -> str:
    """Return a fingerprint of everything that a training depends on."""
    digest = hashlib.sha256(f"{dataset.name} {settings} {seed} {source_digest(_ROOM)}".encode())
    for part in (dataset.training, dataset.validation):
        for array in (part.actions, part.endpoints_m, part.weights):
            digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def _best(history: Sequence[Epoch]) -> Epoch:
    return min(history, key=_loss)


def _loss(epoch: Epoch) -> float:
    return epoch.validation_loss if math.isfinite(epoch.validation_loss) else math.inf


def _keep(
    fit: Fit, path: Path, subject: str, history: list[Epoch], best: dict[str, torch.Tensor]
) -> None:
    """Write the state of a training into one file."""
    tensors = {f"now/{name}": v.detach().clone() for name, v in fit.module.state_dict().items()}
    tensors |= {f"best/{name}": v for name, v in best.items()}
    for index, state in fit.optimizer.state_dict()["state"].items():
        tensors |= {f"optimizer/{index}/{name}": v for name, v in state.items()}
    told = {"subject": subject, "history": json.dumps([asdict(e) for e in history])}
    with atomic_file(path) as temporary:
        save_file(tensors, temporary, metadata=told)


def _resume(
    fit: Fit, path: Path | None, subject: str
) -> tuple[list[Epoch], dict[str, torch.Tensor]]:
    """Put `fit` where a killed training of the same subject was; return its past."""
    if path is None or not path.exists():
        return [], {}
    with safe_open(path, framework="pt") as file:
        told = file.metadata()
        if told["subject"] != subject:
            return [], {}
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    fit.module.load_state_dict(_under(tensors, "now/"))
    optimizer = fit.optimizer.state_dict()
    states: dict[int, dict[str, torch.Tensor]] = {}
    for name, tensor in _under(tensors, "optimizer/").items():
        index, key = name.split("/")
        states.setdefault(int(index), {})[key] = tensor
    fit.optimizer.load_state_dict({**optimizer, "state": states})
    return [Epoch(**entry) for entry in json.loads(told["history"])], _under(tensors, "best/")


def _under(tensors: dict[str, torch.Tensor], prefix: str) -> dict[str, torch.Tensor]:
    return {n.removeprefix(prefix): v for n, v in tensors.items() if n.startswith(prefix)}
