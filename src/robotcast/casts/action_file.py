"""Actions in a CSV file: the casts that a diagnosis asks for, or that a user wrote down."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from robotcast.casts.action import ACTION_COLUMNS, Action
from robotcast.casts.table import read_table
from robotcast.files import atomic_file


def write_actions(rows: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Write one action a row, its six numbers first; what else a row holds goes after them."""
    names = [*ACTION_COLUMNS, *(n for n in (rows[0] if rows else {}) if n not in ACTION_COLUMNS)]
    columns = {name: [_cell(row[name]) for row in rows] for name in names}
    with atomic_file(path) as temporary:
        pl.DataFrame(columns).write_csv(temporary)


def read_actions(path: Path, can: Callable[[np.ndarray], np.ndarray] | None = None) -> list[Action]:
    """Read one action a row, checked as in a measurement set; other columns are ignored.

    Given `can`, which tells of actions (n, 6) which the arm can do, another is refused by line.
    """
    if not path.is_file():
        raise ValueError(f"{path}: there is no such file; expected a table of actions")
    table = read_table(path, ACTION_COLUMNS)
    if not len(table.rows):
        raise ValueError(f"{path}: holds no action")
    numbers = np.stack(list(table.columns.values()), axis=1)
    if can is not None:
        table.refuse_where(
            ~can(numbers), lambda i: "the arm cannot do this action or its mirror image"
        )
    return [Action.from_array(row) for row in numbers]


def _cell(value: Any) -> Any:
    return " ".join(map(str, value)) if isinstance(value, list | tuple) else value
