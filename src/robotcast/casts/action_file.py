"""Actions in a CSV file: the casts that a diagnosis asks for, or that a user wrote down."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import polars as pl

from robotcast.casts.action import ACTION_COLUMNS, Action
from robotcast.files import atomic_file


def write_actions(rows: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Write one action a row, its six numbers first; what else a row holds goes after them."""
    names = [*ACTION_COLUMNS, *(n for n in (rows[0] if rows else {}) if n not in ACTION_COLUMNS)]
    columns = {name: [_cell(row[name]) for row in rows] for name in names}
    with atomic_file(path) as temporary:
        pl.DataFrame(columns).write_csv(temporary)


def read_actions(path: Path) -> list[Action]:
    """Read one action a row; columns with other names are ignored."""
    if not path.is_file():
        raise ValueError(f"{path}: there is no such file; expected a table of actions")
    try:
        table = pl.read_csv(path)
    except pl.exceptions.PolarsError as error:
        raise ValueError(f"{path}: {str(error).strip().splitlines()[0]}") from None
    missing = [name for name in ACTION_COLUMNS if name not in table.columns]
    if missing:
        raise ValueError(f"{path}: expected a column {missing[0]}, got {', '.join(table.columns)}")
    actions = []
    for line, row in enumerate(table.select(ACTION_COLUMNS).rows(), start=2):
        if not all(isinstance(value, int | float) for value in row):
            raise ValueError(f"{path} line {line}: expected six numbers, got {row}")
        actions.append(Action(*map(float, row)))
    if not actions:
        raise ValueError(f"{path}: holds no action")
    return actions


def _cell(value: Any) -> Any:
    return " ".join(map(str, value)) if isinstance(value, list | tuple) else value
