"""Cells of tables from numbers."""

from collections.abc import Sequence

import numpy as np

from robotcast.reporting.results import Evaluation
from robotcast.reporting.table import Cell


def quartiles(evaluation: Evaluation | None) -> tuple[float | None, ...]:
    if evaluation is None or len(evaluation.errors_percent) == 0:
        return (None,) * 5
    return tuple(np.percentile(evaluation.errors_percent, [50, 25, 75, 0, 100]).tolist())


def median_and_repeats(evaluation: Evaluation | None) -> tuple[Cell, ...]:
    """Return the median's 95 % interval, then what repeats of one cast differ by."""
    if evaluation is None or len(evaluation.errors_percent) == 0:
        return (Cell(None),) * 3
    low, high = evaluation.median_interval or (None, None)
    return Cell(low), Cell(high), Cell(evaluation.scatter_percent)


def shares(evaluation: Evaluation) -> tuple[Cell, Cell]:
    """Return repeatability's and the model's share of the mean square error, in %."""
    parts = evaluation.parts
    if parts is None:
        return Cell(None), Cell(None)
    share = 100 * parts.repeatability_share
    return Cell(share), Cell(100 - share)


def plain_cells(rows: Sequence[Sequence[float | None]], digits: int) -> list[tuple[Cell, ...]]:
    return [tuple(Cell(v, digits) for v in row) for row in rows]


def marked(rows: Sequence[Sequence[float | None]], digits: int) -> list[tuple[Cell, ...]]:
    """Turn numbers into cells, the lowest of each column marked if there is more than one."""
    best = []
    for column in zip(*rows, strict=True):
        shown = [round(v, digits) for v in column if v is not None]
        best.append(min(shown) if len(shown) > 1 else None)
    return [
        tuple(
            Cell(v, digits, v is not None and b is not None and round(v, digits) == b)
            for v, b in zip(row, best, strict=True)
        )
        for row in rows
    ]
