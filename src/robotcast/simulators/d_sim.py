"""D_sim: where a tuned simulator says that many casts come to rest (paper, "D_sim").

On disk it lies whole, or in shards that merge into the same bytes as the whole. A shard is a run of
consecutive actions of the grid. A cast does not depend on those simulated beside it, so shards may
be generated anywhere, in any order.
"""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import yaml

from robotcast.casts.action import ACTION_COLUMNS, ToolMotion, action_factors
from robotcast.casts.plan import PlannedCast
from robotcast.files import atomic_file, write_yaml
from robotcast.running import Progress, silent
from robotcast.simulators.simulator import Cast, SimulatedCast, Simulator

ACTIONS_AT_ONCE = 4096  # planned and simulated together, which bounds the memory
CASTS, FACTS = "casts.parquet", "generation.yaml"


def generate_casts(
    simulator: Simulator,
    vector: np.ndarray,
    actions: np.ndarray,
    plan: Callable[[np.ndarray], Sequence[PlannedCast]],
    *,
    settle_s: float,
    follow: Callable[[ToolMotion], ToolMotion] = lambda commanded: commanded,
    reach_m: np.ndarray | None = None,
    progress: Progress = silent,
) -> np.ndarray:
    """Return where the casts that `plan` makes of `actions` (n, 6) end under one parameter vector.

    Endpoints (n, 2) [m] are NaN where the run diverged. They are read `settle_s` after the tool
    should stop at the latest; a cable that rests earlier is not simulated further. `follow` turns
    the motion that an arm is commanded into the one it makes (`Following.motion`). Before the cast
    the free end lies `reach_m` (2,) from the tool, `mean_reach` of casts that were measured; None
    starts the cable along the tool's yaw.
    """
    endpoints_m = np.empty((len(actions), 2))

    def of_all(first: int, done: int, total: int, note: str = "") -> None:
        progress(first + done, len(actions), note)

    for first in range(0, len(actions), ACTIONS_AT_ONCE):
        part = slice(first, first + ACTIONS_AT_ONCE)
        casts = []
        for action, planned in zip(actions[part], plan(actions[part]), strict=True):
            tool, last_s = follow(planned.tool), np.array([planned.end_s + settle_s])
            start_m = None if reach_m is None else tool.pose[0, :2] + reach_m
            casts.append(SimulatedCast(tool, last_s, start_m, action_factors(action)))
        prediction = simulator.simulate(casts, vector, progress=partial(of_all, first))
        endpoints_m[part] = prediction.waypoints_m[0, :, 0]
    return endpoints_m


def mean_reach(casts: Iterable[Cast]) -> np.ndarray | None:
    """Return where the free end lies from the tool, (2,), on average, before measured casts.

    Resets lay a cable a little to one side; None where no cast shows it.
    """
    seen = [cast.start_m - cast.tool.pose[0, :2] for cast in casts if cast.start_m is not None]
    return np.mean(seen, axis=0) if seen else None


def shard_name(number: int, of: int) -> str:
    """Return what the folder of one of `of` parts of a grid is called, numbered from 0."""
    if not 0 <= number < of:
        raise ValueError(f"of {of} shards there is none numbered {number}")
    return f"{number}-of-{of}"


def write_d_sim(
    folder: Path, actions: np.ndarray, endpoints_m: np.ndarray, facts: dict[str, Any]
) -> dict[str, Any]:
    """Write the casts that did not diverge, and how they came to be; return that."""
    kept = np.isfinite(endpoints_m).all(axis=1)
    columns = dict(zip(ACTION_COLUMNS, actions[kept].T, strict=True))
    x, y = endpoints_m[kept].T
    facts = {**facts, "casts": int(kept.sum()), "diverged": int((~kept).sum())}
    _write(folder, pl.DataFrame({**columns, "x": x, "y": y}), facts)
    return facts


def merge_shards(folders: Sequence[Path], folder: Path) -> dict[str, Any]:
    """Write one D_sim from the folders of all its shards, in their order; return its facts."""
    read = []
    for path in folders:
        if not (path / FACTS).exists():
            raise FileNotFoundError(f"{path / FACTS} is missing: generate this shard first")
        read.append(yaml.safe_load((path / FACTS).read_text(encoding="utf-8")))
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


def _write(folder: Path, casts: pl.DataFrame, facts: dict[str, Any]) -> None:
    """Write the casts, then the facts: a folder with facts is whole."""
    with atomic_file(folder / CASTS) as temporary:
        casts.write_parquet(temporary)
    write_yaml(folder / FACTS, facts)
