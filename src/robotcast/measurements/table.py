"""One table of a measurement set: its file, its columns as numbers, where a row stands."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import polars as pl

TABLE_COLUMNS = {
    "actions": ("trial", "action", "theta1", "r1", "theta2", "r2", "alpha", "vmax"),
    "tool": ("trial", "t", "x", "y", "yaw"),
    "waypoints": ("trial", "t", "x", "y"),
}
WHOLE_COLUMNS = ("trial", "action")


@dataclass(frozen=True)
class Table:
    """The columns of one file, every cell a finite number.

    Attributes
    ----------
    columns : name → ndarray of shape (n_rows,).
    rows : ndarray of shape (n_rows,); where each row stands in the file: the line of a CSV file
        (the header is line 1), the row of a Parquet file (the first is row 1).
    others : further columns that hold a finite number in every row, by name.
    """

    path: Path
    columns: dict[str, np.ndarray]
    rows: np.ndarray
    others: dict[str, np.ndarray] = field(default_factory=dict)

    def place(self, index: int) -> str:
        """Say where row `index` stands, as messages name it."""
        return _place(self.path, int(self.rows[index]))

    def refuse_where(self, bad: np.ndarray, say: Callable[[int], str]) -> None:
        """Refuse the first row for which `bad` (n_rows,) holds; `say(index)` is the rule."""
        if bad.any():
            first = int(np.argmax(bad))
            raise ValueError(f"{self.place(first)}: {say(first)}")


def find_table(folder: Path, name: str) -> Path | None:
    """Return the file of table `name`, None when there is none; refuse to choose between two."""
    found = [p for p in (folder / f"{name}.csv", folder / f"{name}.parquet") if p.is_file()]
    if len(found) > 1:
        raise ValueError(
            f"{folder}: expected {name} as CSV or as Parquet, found both {name}.csv and "
            f"{name}.parquet"
        )
    return found[0] if found else None


def read_table(path: Path, names: tuple[str, ...]) -> Table:
    """Read the columns `names` of `path`; others are kept where they hold numbers.

    Raises
    ------
    ValueError
        A file that cannot be parsed, a missing column, or a cell that is no finite number.
    """
    if path.suffix == ".csv":
        frame, rows = _read_csv(path, names)
    else:
        frame, rows = _read_parquet(path, names)
    columns = {name: _numbers(path, frame[name], rows) for name in names}
    return Table(path, columns, rows, _others(frame, names))


def _others(frame: pl.DataFrame, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    found = {}
    for name in (name for name in frame.columns if name not in names):
        cells = frame[name]
        if cells.dtype == pl.String:
            cells = cells.str.strip_chars()
        if cells.dtype.is_numeric() or cells.dtype == pl.String:
            values = cells.cast(pl.Float64, strict=False).to_numpy().astype(float)
            if np.isfinite(values).all():
                found[name] = values
    return found


def _place(path: Path, row: int) -> str:
    return f"{path} {'line' if path.suffix == '.csv' else 'row'} {row}"


def _read_csv(path: Path, names: tuple[str, ...]) -> tuple[pl.DataFrame, np.ndarray]:
    try:
        header = _csv_header(path)
        _require_columns(path, names, header)
        frame = pl.read_csv(path, infer_schema=False)
    except UnicodeDecodeError:
        raise ValueError(f"{path}: is not text in UTF-8") from None
    except pl.exceptions.PolarsError as error:
        raise ValueError(_ragged_line(path) or f"{path}: {_first_line(error)}") from None
    frame = frame.rename(dict(zip(frame.columns, header, strict=True)))
    blank = frame.select(pl.all_horizontal(pl.all().is_null())).to_series().to_numpy()
    return frame.filter(~blank), np.arange(2, 2 + frame.height)[~blank]


def _csv_header(path: Path) -> list[str]:
    with path.open(encoding="utf-8-sig") as file:
        header = [name.strip().strip('"') for name in file.readline().split(",")]
    if header == [""]:
        raise ValueError(f"{_place(path, 1)}: expected the names of the columns, got nothing")
    if len(set(header)) < len(header):
        twice = next(name for name in header if header.count(name) > 1)
        raise ValueError(f"{_place(path, 1)}: column {twice} stands there twice")
    return header


def _require_columns(path: Path, names: tuple[str, ...], found: list[str]) -> None:
    missing = [name for name in names if name not in found]
    if missing:
        raise ValueError(
            f"{path}: column {missing[0]} is missing; expected {', '.join(names)}, "
            f"found {', '.join(found)}"
        )


def _ragged_line(path: Path) -> str | None:
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    expected = lines[0].count(",") + 1
    for number, line in enumerate(lines, start=1):
        if line.count(",") + 1 > expected:
            return (
                f"{_place(path, number)}: expected {expected} cells as in the header, "
                f"got {line.count(',') + 1}"
            )
    return None


def _read_parquet(path: Path, names: tuple[str, ...]) -> tuple[pl.DataFrame, np.ndarray]:
    try:
        frame = pl.read_parquet(path)
    except pl.exceptions.PolarsError as error:
        raise ValueError(f"{path}: is not readable as Parquet ({_first_line(error)})") from None
    _require_columns(path, names, frame.columns)
    return frame, np.arange(1, 1 + frame.height)


def _first_line(error: Exception) -> str:
    return str(error).strip().splitlines()[0]


def _numbers(path: Path, cells: pl.Series, rows: np.ndarray) -> np.ndarray:
    if cells.dtype == pl.String:
        cells = cells.str.strip_chars()
    if not (cells.dtype.is_numeric() or cells.dtype in (pl.String, pl.Null)):
        raise ValueError(f"{path}: column {cells.name} holds {cells.dtype}, expected numbers")
    values = cells.cast(pl.Float64, strict=False).to_numpy().astype(float)
    bad = ~np.isfinite(values)
    expected = "a finite number"
    if cells.name in WHOLE_COLUMNS:
        bad |= values != np.round(values)
        bad |= np.abs(values) > 2**53
        expected = "a whole number"
    if bad.any():
        first = int(np.argmax(bad))
        cell = cells[first]
        got = "an empty cell" if cell in (None, "") else repr(cell)
        raise ValueError(
            f"{_place(path, int(rows[first]))}: {cells.name} must be {expected}, got {got}"
        )
    return values.astype(np.int64) if cells.name in WHOLE_COLUMNS else values
