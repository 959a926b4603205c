"""Writing a measurement set, once and in one step."""

from pathlib import Path
from typing import Literal

import numpy as np
import polars as pl

from robotcast.files import atomic_folder
from robotcast.measurements.measurement_set import MeasurementSet
from robotcast.measurements.rig_file import RigFacts, rig_file_text
from robotcast.measurements.table import TABLE_COLUMNS, WHOLE_COLUMNS

TableFormat = Literal["csv", "parquet"]


def write_measurement_set(
    measured: MeasurementSet, folder: Path, table_format: TableFormat = "csv"
) -> None:
    """Write a set to `folder`, which must not exist yet: a set on disk is never changed.

    The same set gives the same bytes; numbers are written with all their digits, so that
    reading gives the set back. A planned tool motion is not written: it was not measured.
    """
    if table_format not in ("csv", "parquet"):
        raise ValueError(f"table format must be csv or parquet, got {table_format!r}")
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
        for name, rows in _tables(measured).items():
            columns = [*TABLE_COLUMNS[name], *(_logged(measured) if name == "actions" else ())]
            _write_table(unfinished, name, columns, rows, table_format)


def _logged(measured: MeasurementSet) -> list[str]:
    """Return what was logged with every cast beside its action; the order is never written."""
    names = set.intersection(*(set(t.logged) for t in measured.trials))
    return sorted(names - {"order"})


def _tables(measured: MeasurementSet) -> dict[str, np.ndarray]:
    trials, logged = measured.trials, _logged(measured)
    tables = {
        "actions": np.stack(
            [
                np.r_[t.trial, t.action_id, t.action.as_array(), [t.logged[n] for n in logged]]
                for t in trials
            ]
        ),
        "waypoints": np.concatenate([_rows(t.trial, t.waypoints_s, t.waypoints_m) for t in trials]),
    }
    if not measured.tool_planned:
        tables["tool"] = np.concatenate([_rows(t.trial, t.tool.t_s, t.tool.pose) for t in trials])
    return tables


def _rows(trial: int, t_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.column_stack([np.full(len(t_s), trial), t_s, values])


def _write_table(
    folder: Path, name: str, columns: list[str], rows: np.ndarray, table_format: TableFormat
) -> None:
    whole = [pl.col(column).cast(pl.Int64) for column in columns if column in WHOLE_COLUMNS]
    frame = pl.DataFrame(rows, schema=columns).with_columns(whole)
    if table_format == "csv":
        frame.write_csv(folder / f"{name}.csv")
    else:
        frame.write_parquet(folder / f"{name}.parquet")
