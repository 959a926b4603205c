"""Forward models on disk: numbers as safetensors, the rest as YAML and CSV, no pickles."""

import hashlib
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl
import torch
import yaml
from safetensors.torch import load_file, save_file

from robotcast.files import atomic_file, write_text
from robotcast.policies.learning.training import Epoch, best_epoch

WEIGHTS_FILE, HISTORY_FILE, DESCRIPTION_FILE = "weights.safetensors", "training.csv", "policy.yaml"


@dataclass(frozen=True)
class Stored:
    """What `read_model` found.

    Attributes
    ----------
    told : the description that `write_model` was given.
    """

    tensors: dict[str, torch.Tensor]
    told: dict[str, Any]
    history: tuple[Epoch, ...]


def write_model(
    folder: Path,
    tensors: Mapping[str, torch.Tensor],
    told: Mapping[str, Any],
    history: Sequence[Epoch],
) -> None:
    """Write weights.safetensors, training.csv and, last, policy.yaml into `folder`."""
    weights = folder / WEIGHTS_FILE
    with atomic_file(weights) as temporary:
        save_file({name: v.contiguous() for name, v in tensors.items()}, temporary)
    text = io.StringIO()
    pl.DataFrame([vars(e) for e in history]).write_csv(text, float_precision=6)
    write_text(folder / HISTORY_FILE, text.getvalue())
    best = best_epoch(history)
    description = {
        **told,
        "epochs": len(history),
        "best_epoch": best.epoch,
        "validation_median_m": round(best.validation_median_m, 6),
        "weights_sha256": hashlib.sha256(weights.read_bytes()).hexdigest(),
    }
    write_text(folder / DESCRIPTION_FILE, yaml.safe_dump(description, sort_keys=False))


def read_description(folder: Path) -> dict[str, Any]:
    """Read policy.yaml, which is written last; say what to run where there is none."""
    description = folder / DESCRIPTION_FILE
    if not description.exists():
        raise FileNotFoundError(f"{description} is missing: run the train stage first")
    return yaml.safe_load(description.read_text(encoding="utf-8"))


def read_model(folder: Path) -> Stored:
    """Read what `write_model` wrote; refuse weights that are not of the description."""
    told = read_description(folder)
    weights = folder / WEIGHTS_FILE
    if hashlib.sha256(weights.read_bytes()).hexdigest() != told["weights_sha256"]:
        raise ValueError(f"{weights} does not belong to {DESCRIPTION_FILE} beside it: train again")
    history = pl.read_csv(folder / HISTORY_FILE).iter_rows(named=True)
    return Stored(load_file(weights), told, tuple(Epoch(**row) for row in history))
