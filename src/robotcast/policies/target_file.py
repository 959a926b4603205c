"""Targets that a user chose beforehand, in a CSV file."""

from pathlib import Path

import numpy as np
import polars as pl

from robotcast.policies.targets import Board


def read_targets(path: Path, board: Board) -> np.ndarray:
    """Read one target a row, columns x and y [m] in the robot base's frame, as (k, 2).

    Columns with other names are ignored. Raises ValueError, naming the line, for what is no
    number or lies off the board.
    """
    if not path.is_file():
        raise ValueError(f"{path}: there is no such file; expected a table of targets")
    try:
        table = pl.read_csv(path)
    except pl.exceptions.PolarsError as error:
        raise ValueError(f"{path}: {str(error).strip().splitlines()[0]}") from None
    missing = [name for name in ("x", "y") if name not in table.columns]
    if missing:
        raise ValueError(f"{path}: expected a column {missing[0]}, got {', '.join(table.columns)}")
    for line, (x, y) in enumerate(table.select("x", "y").rows(), start=2):
        if not (isinstance(x, int | float) and isinstance(y, int | float)):
            raise ValueError(f"{path} line {line}: expected two numbers, got ({x}, {y})")
        if not (0 <= x <= board.length_m and abs(y) <= board.width_m / 2):
            raise ValueError(
                f"{path} line {line}: ({x:g}, {y:g}) m lies off the board, x from 0 to "
                f"{board.length_m:g} m and y from {-board.width_m / 2:g} to {board.width_m / 2:g} m"
            )
    if table.is_empty():
        raise ValueError(f"{path}: holds no target")
    return table.select("x", "y").to_numpy().astype(float)
