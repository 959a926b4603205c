"""Writing a measurement set, once and in one step."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import polars as pl

from robotcast.casts.action import ACTION_COLUMNS
from robotcast.casts.table import TABLE_COLUMNS
from robotcast.files import atomic_folder
from robotcast.measurements.measurement_set import MeasurementSet
from robotcast.measurements.reader import RigFacts, read_measurement_set, rig_file_text


@contextmanager
def replaced(folder: Path) -> Iterator[Path]:
    """Yield where to write a set that takes the place of `folder` once it can be read."""
    draft = folder.with_name(f".{folder.name}.draft")
    shutil.rmtree(draft, ignore_errors=True)
    try:
        yield draft
        read_measurement_set(draft)
        shutil.rmtree(folder, ignore_errors=True)
        draft.rename(folder)
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def write_measurement_set(measured: MeasurementSet, folder: Path) -> None:
    """Write a set to `folder`, which must not exist yet: a set on disk is never changed.

    The same set gives the same bytes; numbers are written with all their digits, so that
    reading gives the set back. A planned tool motion is not written: it was not measured.
    """
    if folder.exists():
        raise ValueError(
            f"{folder}: exists already; a measurement set is never changed in place, "
            "write to another folder"
        )
    if not measured.trials:
        raise ValueError(f"{folder}: a measurement set without casts is not written")
    facts = RigFacts(
        measured.cable, measured.r0_m, measured.period_s, measured.noise_m, measured.rig
    )
    with atomic_folder(folder) as unfinished:
        (unfinished / "rig.yaml").write_text(rig_file_text(facts), encoding="utf-8")
        for name, columns in _tables(measured).items():
            pl.DataFrame(columns).write_csv(unfinished / f"{name}.csv")


def _tables(measured: MeasurementSet) -> dict[str, dict[str, np.ndarray]]:
    """Return the columns of each table; the order of the casts is never written."""
    trials = measured.trials
    numbers = np.array([t.trial for t in trials])
    actions = np.stack([t.action.as_array() for t in trials])
    logged = sorted(set.intersection(*(set(t.logged) for t in trials)) - {"order"})
    tables = {
        "actions": {"trial": numbers, "action": np.array([t.action_id for t in trials])}
        | dict(zip(ACTION_COLUMNS, actions.T, strict=True))
        | {name: np.array([t.logged[name] for t in trials]) for name in logged}
    }
    if not all(t.rested for t in trials):
        tables["actions"]["rested"] = np.array([int(t.rested) for t in trials])
    logs = {"waypoints": [(t.waypoints_s, t.waypoints_m) for t in trials]}
    if not measured.tool_planned:
        logs["tool"] = [(t.tool.t_s, t.tool.pose) for t in trials]
    for name, log in logs.items():
        counts = [len(t_s) for t_s, _ in log]
        values = np.concatenate([some for _, some in log])
        tables[name] = {
            "trial": np.repeat(numbers, counts),
            "t": np.concatenate([t_s for t_s, _ in log]),
        } | dict(zip(TABLE_COLUMNS[name][2:], values.T, strict=True))
    return tables
