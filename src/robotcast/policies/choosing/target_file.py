"""Targets that a user chose beforehand, in a CSV or Parquet file."""

from pathlib import Path

import numpy as np

from robotcast.measurements.table import read_table
from robotcast.policies.choosing.targets import Board


def read_targets(path: Path, board: Board) -> np.ndarray:
    """Read one target a row, columns x and y [m] in the robot base's frame, as (k, 2).

    Columns with other names are ignored. Raises ValueError, naming the row, for what is no
    finite number or lies off the board.
    """
    if not path.is_file():
        raise ValueError(f"{path}: there is no such file; expected a table of targets")
    table = read_table(path, ("x", "y"))
    x, y = table.columns["x"], table.columns["y"]
    if not len(x):
        raise ValueError(f"{path}: holds no target")
    length, half = board.length_m, board.width_m / 2
    table.refuse_where(
        (x < 0) | (x > length) | (np.abs(y) > half),
        lambda row: (
            f"({x[row]:g}, {y[row]:g}) m lies off the board, x from 0 to {length:g} m and "
            f"y from {-half:g} to {half:g} m"
        ),
    )
    return np.stack([x, y], axis=1)
