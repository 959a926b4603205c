"""Tables of casts on disk: columns as numbers in range, and where each row stands."""

import csv
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from robotcast.casts.action import ACTION_COLUMNS, Action
from robotcast.files import write_text

TABLE_COLUMNS = {
    "actions": ("trial", "action", "theta1", "r1", "theta2", "r2", "alpha", "vmax"),
    "tool": ("trial", "t", "x", "y", "yaw"),
    "waypoints": ("trial", "t", "x", "y"),
}
WHOLE_COLUMNS = ("trial", "action")
MOST_SHOWN = 40  # characters of a cell in a message
UNNAMED = "Unnamed"  # as pandas calls a column without a name, its index for one


@dataclass(frozen=True)
class Range:
    """What a column may hold, and which unit is taken for another where it holds more."""

    most: float
    unit: str
    mistaken: str
    positive: bool = False


_PER_SECOND = "millimetres per second where metres per second are expected?"
_FROM_START = (
    "t counts seconds from the start of its cast: milliseconds, sample numbers or the time of "
    "a clock instead?"
)
_ANGLE = Range(2 * math.pi, "rad", "degrees where radians are expected?")
_LENGTH = Range(10.0, "m", "millimetres where metres are expected?")
RANGES = {
    "theta1": _ANGLE,
    "theta2": _ANGLE,
    "alpha": _ANGLE,
    "yaw": _ANGLE,
    "x": _LENGTH,
    "y": _LENGTH,
    "r1": replace(_LENGTH, positive=True),
    "r2": replace(_LENGTH, positive=True),
    "vmax": Range(10.0, "m/s", _PER_SECOND, positive=True),
    "t": Range(60.0, "s", _FROM_START),
}


@dataclass(frozen=True)
class Table:
    """The columns of one file, every cell a finite number, by name (n_rows,)."""

    path: Path
    columns: dict[str, np.ndarray]
    rows: np.ndarray  # (n_rows,): a CSV file's line, the header is line 1; a Parquet file's row
    others: dict[str, np.ndarray] = field(default_factory=dict)  # further columns of numbers

    def place(self, index: int) -> str:
        """Say where row `index` stands, as messages name it."""
        return _place(self.path, int(self.rows[index]))

    def refuse_where(self, bad: np.ndarray, say: Callable[[int], str]) -> None:
        """Refuse the first row for which `bad` (n_rows,) holds; `say(index)` is the rule."""
        if bad.any():
            first = int(np.argmax(bad))
            raise ValueError(f"{self.place(first)}: {say(first)}")

    def take(self, rows: np.ndarray) -> "Table":
        """Return the table with the rows at `rows`, indices in any order."""
        columns = {name: cells[rows] for name, cells in self.columns.items()}
        others = {name: cells[rows] for name, cells in self.others.items()}
        return Table(self.path, columns, self.rows[rows], others)


def find_table(folder: Path, name: str) -> Path | None:
    """Return the file of table `name`, None when there is none; refuse to choose between two."""
    found = [p for p in (folder / f"{name}.csv", folder / f"{name}.parquet") if p.is_file()]
    if len(found) > 1:
        both = " and ".join(path.name for path in found)
        raise ValueError(f"{folder}: expected {name} as CSV or as Parquet, found both {both}")
    return found[0] if found else None


def read_table(path: Path, names: tuple[str, ...]) -> Table:
    """Read the columns `names` of `path`; others are kept where they hold numbers.

    Raises ValueError for a file that cannot be parsed, a missing column, and a cell that is no
    finite number or beyond the range of its column.
    """
    try:
        frame, rows = (_read_csv if path.suffix == ".csv" else _read_parquet)(path, names)
    except OSError as error:
        raise ValueError(f"{path}: cannot be read ({error.strerror})") from None
    frame = frame.with_columns(pl.col(pl.String).str.strip_chars())
    columns = {name: _numbers(path, frame[name], rows) for name in names}
    table = Table(path, columns, rows, _others(frame, names))
    for name in names:
        if name in RANGES:
            _refuse_out_of_range(table, name, RANGES[name])
    return table


def _refuse_out_of_range(table: Table, name: str, within: Range) -> None:
    value = table.columns[name]
    if name == "t":
        table.refuse_where(
            value < 0, lambda i: f"t is {value[i]:g}, before the start of the cast at t = 0"
        )
    if within.positive:
        table.refuse_where(value <= 0, lambda i: f"{name} must be above zero, got {value[i]:g}")
    most = "2π" if within is _ANGLE else f"{within.most:g}"
    table.refuse_where(
        np.abs(value) > within.most,
        lambda i: f"{name} is {value[i]:g}, beyond {most} {within.unit}; {within.mistaken}",
    )


def _others(frame: pl.DataFrame, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    found = {}
    for cells in frame:
        known = cells.name in names or cells.name.startswith(UNNAMED)
        if not known and (cells.dtype.is_numeric() or cells.dtype == pl.String):
            values = _floats(cells)
            if np.isfinite(values).all():
                found[cells.name] = values
    return found


def _floats(cells: pl.Series) -> np.ndarray:
    """Return the cells as numbers, NaN where they are none."""
    return cells.cast(pl.Float64, strict=False).to_numpy().astype(float)


def _place(path: Path, row: int) -> str:
    return f"{path} {'line' if path.suffix == '.csv' else 'row'} {row}"


def _read_csv(path: Path, names: tuple[str, ...]) -> tuple[pl.DataFrame, np.ndarray]:
    data = path.read_bytes()
    if b"\n" not in data:
        data = data.replace(b"\r", b"\n")  # as old Macs end lines
    if any(end in data for end in (b",\n", b",\r", b", \n", b", \r", b",\t")) or data[-1:] == b",":
        data = re.sub(rb"(?:,[ \t]*)+(?=\r?\n|\Z)", b"", data)  # empty cells at the end of a line
    try:
        header = _csv_header(path, data)
        _require_columns(path, names, header)
        frame = pl.read_csv(data, infer_schema=False)
    except UnicodeDecodeError:
        raise ValueError(f"{path}: is not text in UTF-8; export it as CSV in UTF-8") from None
    except pl.exceptions.PolarsError as error:
        raise ValueError(_ragged_line(path, data) or f"{path}: {_first_line(error)}") from None
    frame = frame.rename(dict(zip(frame.columns, header, strict=True)))
    cells = pl.all().fill_null("").str
    blank = frame.select(pl.all_horizontal(cells.strip_chars() == "")).to_series().to_numpy()
    lines = np.ones(frame.height, int)
    if b'"' in data:  # a quoted cell may go over several lines
        lines += frame.select(pl.sum_horizontal(cells.count_matches("\n"))).to_series().to_numpy()
    return frame.filter(~blank), (2 + np.cumsum(lines) - lines)[~blank]


def _csv_header(path: Path, data: bytes) -> list[str]:
    line = data[: data.find(b"\n") if b"\n" in data else None].decode("utf-8-sig").strip()
    place = _place(path, 1)
    if not line:
        raise ValueError(f"{place}: expected the names of the columns, got nothing")
    if line.startswith("#"):
        raise ValueError(f"{place}: expected the names of the columns, got a comment: {line}")
    for separator, called in ((";", "semicolons"), ("\t", "tabs")):
        if separator in line and "," not in line:
            raise ValueError(
                f"{place}: cells are separated by {called}, found {line}; "
                "export with commas between cells, and points in numbers"
            )
    header = [name.strip() for name in next(csv.reader([line], skipinitialspace=True))]
    header = [name or f"{UNNAMED}: {column}" for column, name in enumerate(header)]
    if len(set(header)) < len(header):
        twice = next(name for name in header if header.count(name) > 1)
        raise ValueError(f"{place}: column {twice} stands there twice")
    return header


def _require_columns(path: Path, names: tuple[str, ...], found: list[str]) -> None:
    missing = [name for name in names if name not in found]
    if missing:
        raise ValueError(
            f"{path}: column {missing[0]} is missing; expected {', '.join(names)}, "
            f"found {', '.join(found)}"
        )


def _ragged_line(path: Path, data: bytes) -> str | None:
    lines = data.decode("utf-8", errors="replace").splitlines()
    cells = [line.count(",") + 1 for line in lines]
    for number, count in enumerate(cells, start=1):
        if count > cells[0]:
            return (
                f"{_place(path, number)}: expected {cells[0]} cells as in the header, "
                f"got {count}; are there commas in the numbers?"
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
    if not (cells.dtype.is_numeric() or cells.dtype in (pl.String, pl.Null)):
        raise ValueError(f"{path}: column {cells.name} holds {cells.dtype}, expected numbers")
    whole = cells.name in WHOLE_COLUMNS
    values = _floats(cells)
    bad = ~np.isfinite(values)
    if whole:
        bad |= (values != np.round(values)) | (np.abs(values) >= 2**63)
    if bad.any():
        first = int(np.argmax(bad))
        cell = cells[first]
        got = "an empty cell" if cell in (None, "") else repr(cell)[:MOST_SHOWN]
        expected = "a whole number" if whole else "a finite number"
        raise ValueError(
            f"{_place(path, int(rows[first]))}: {cells.name} must be {expected}, got {got}"
        )
    if not whole:
        return values
    exact = cells.cast(pl.Int64, strict=False)  # a time stamp in ns is no exact float
    return values.astype(np.int64) if exact.null_count() else exact.to_numpy()


def _cell(value: Any) -> Any:
    return " ".join(map(str, value)) if isinstance(value, list | tuple) else value


def write_actions(rows: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Write one action a row, its six numbers first; what else a row holds goes after them."""
    names = [*ACTION_COLUMNS, *(n for n in (rows[0] if rows else {}) if n not in ACTION_COLUMNS)]
    columns = {name: [_cell(row[name]) for row in rows] for name in names}
    write_text(path, pl.DataFrame(columns).write_csv())


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
        refused = "the arm cannot do this action or its mirror image"
        table.refuse_where(~can(numbers), lambda _: refused)
    return [Action.from_array(row) for row in numbers]
