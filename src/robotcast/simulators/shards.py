"""D_sim on disk, whole or in shards that merge into the same bytes as the whole.

A shard is a run of consecutive actions of the grid. A cast does not depend on those simulated
beside it, so shards may be generated anywhere, in any order.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import yaml

from robotcast.casts.action import ACTION_COLUMNS
from robotcast.files import atomic_file, write_text
from robotcast.simulators.generation import Generated

CASTS, FACTS = "casts.parquet", "generation.yaml"


@dataclass(frozen=True)
class Shard:
    """One of `of` parts of a grid, numbered from 0."""

    number: int
    of: int

    def __post_init__(self) -> None:
        """Raise ValueError where there is no such part."""
        if not 0 <= self.number < self.of:
            raise ValueError(f"of {self.of} shards there is none numbered {self.number}")

    @property
    def name(self) -> str:
        """What its folder is called."""
        return f"{self.number}-of-{self.of}"

    def part(self, actions: np.ndarray) -> np.ndarray:
        """Return its share of the grid's actions (n, 6)."""
        return np.array_split(actions, self.of)[self.number]


def write_d_sim(folder: Path, generated: Generated, facts: dict[str, Any]) -> None:
    """Write the casts that did not diverge, and how they came to be."""
    kept = ~generated.diverged
    columns = dict(zip(ACTION_COLUMNS, generated.actions[kept].T, strict=True))
    x, y = generated.endpoints_m[kept].T
    counts = {"casts": int(kept.sum()), "diverged": int((~kept).sum())}
    _write(folder, pl.DataFrame({**columns, "x": x, "y": y}), {**facts, **counts})


def merge_shards(folders: Sequence[Path], folder: Path) -> dict[str, Any]:
    """Write one D_sim from the folders of all its shards, in their order; return its facts.

    Raises
    ------
    FileNotFoundError
        When a shard is missing.
    ValueError
        When the shards come from different simulators, grids or limits.
    """
    read = [_facts(path) for path in folders]
    for path, facts in zip(folders, read, strict=True):
        if facts["subject"] != read[0]["subject"]:
            raise ValueError(
                f"{path} and {folders[0]} come from different simulators or grids: "
                "generate all shards again"
            )
    merged = {key: value for key, value in read[0].items() if key != "subject"}
    merged |= {key: sum(facts[key] for facts in read) for key in ("casts", "diverged")}
    tables = [pl.read_parquet(path / CASTS) for path in folders]
    _write(folder, pl.concat(tables, rechunk=True), merged)
    return merged


def _facts(folder: Path) -> dict[str, Any]:
    path = folder / FACTS
    if not path.exists():
        raise FileNotFoundError(f"{path} is missing: generate this shard first")
    return yaml.safe_load(path.read_text(encoding="utf-8"))


def _write(folder: Path, casts: pl.DataFrame, facts: dict[str, Any]) -> None:
    """Write the casts, then the facts: a folder with facts is whole."""
    with atomic_file(folder / CASTS) as temporary:
        casts.write_parquet(temporary)
    write_text(folder / FACTS, yaml.safe_dump(facts, sort_keys=False))
