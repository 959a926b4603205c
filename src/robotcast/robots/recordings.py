"""Files of logs as tables: text, LeRobot datasets, and bags of ROS 2 in MCAP files."""

import json
import re
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import polars as pl

KEPT = 64  # elements of one list that become columns


def episodes(path: Path, table: pl.DataFrame) -> list[tuple[str, pl.DataFrame]]:
    """Return a Parquet file's logs by name: of LeRobot's dataset every episode, else the file.

    Lists become a column an element, named by meta/info.json where that stands above the file.
    """
    lists = [c for c, kind in table.schema.items() if isinstance(kind, pl.List | pl.Array)]
    names = _features(path) if lists else {}
    for column in lists:
        n = min(int(table[column].list.len().max() or 0), KEPT)  # type: ignore[arg-type]
        own = names.get(column, ())
        own = own if len(own) == n else [f"[{k}]" for k in range(n)]
        parts = [pl.col(column).list.get(k).alias(f"{column}{own[k]}") for k in range(n)]
        table = table.with_columns(parts).drop(column)
    if "episode_index" not in table.columns:
        return [(path.name, table)]
    parts = table.partition_by("episode_index", as_dict=True, maintain_order=True)
    return [(f"{path.name}#{number}", part) for (number,), part in parts.items()]


def _features(path: Path) -> dict[str, list[str]]:
    """Return column → names of its elements, each with a dot before it."""
    above = (folder / "meta/info.json" for folder in path.parents)
    info = next((file for file in above if file.is_file()), None)
    if info is None:
        return {}
    found = {}
    said = json.loads(info.read_text(encoding="utf-8"))
    for column, feature in said.get("features", {}).items():
        names = feature.get("names")
        names = next(iter(names.values()), None) if isinstance(names, dict) else names
        if isinstance(names, list):
            found[column] = [f".{name}" for name in names]
    return found


def read_bag(path: Path) -> pl.DataFrame:
    """Return an MCAP file as one table, a row for every message of the topic that has most.

    Numbers of messages become columns, `/joint_states.position.elbow`; other topics hold their
    last value. `time` is when a message was stamped, else logged [s].
    """
    try:
        from mcap.reader import make_reader  # pyright: ignore[reportMissingImports]
        from mcap_ros2.decoder import DecoderFactory  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise ValueError(f"{path}: reading it needs pip install 'robotcast[bags]'") from None
    topics: dict[str, list[dict[str, float]]] = {}
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, logged, message in reader.iter_decoded_messages():
            if numbers := dict(_numbers(message, channel.topic)):
                stamp = getattr(getattr(message, "header", None), "stamp", None)
                seconds = 0.0 if stamp is None else stamp.sec + 1e-9 * stamp.nanosec
                row = {"time": seconds or 1e-9 * logged.log_time, **numbers}
                topics.setdefault(channel.topic, []).append(row)
    tables = [pl.DataFrame(rows, infer_schema_length=None).sort("time") for rows in topics.values()]
    if not tables:
        raise ValueError(f"{path}: no message in it holds numbers")
    table, *others = sorted(tables, key=len, reverse=True)
    for other in others:
        table = table.join_asof(other, on="time")
    return table.drop_nulls() if others else table


def _numbers(message: Any, name: str) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a message and of what lies in it, joints by their names."""
    if isinstance(message, bool | str | bytes) or name.endswith(".header"):
        return
    if isinstance(message, int | float):
        yield name, float(message)
    elif isinstance(message, list | tuple):
        for k, one in enumerate(message[:KEPT]):
            yield from _numbers(one, f"{name}[{k}]")
    else:
        slots = [slot for slot in getattr(message, "__slots__", ()) if not slot.startswith("_")]
        joints = [str(j) for j in getattr(message, "name", ()) or ()]
        for slot in slots:
            value = getattr(message, slot)
            if joints and isinstance(value, list | tuple) and len(value) == len(joints):
                for joint, one in zip(joints, value, strict=True):
                    yield from _numbers(one, f"{name}.{slot}.{joint}")
            else:
                yield from _numbers(value, f"{name}.{slot}")


def tables_of(path: Path) -> list[tuple[str, pl.DataFrame]]:
    """Return the tables in a file by name, whatever their columns hold: one, or its episodes."""
    kind = path.suffix.lower()
    try:
        if kind in (".csv", ".txt"):
            return [(path.name, _read_text(path))]
        if kind == ".mcap":
            return [(path.name, read_bag(path))]
        if kind == ".parquet":
            return episodes(path, pl.read_parquet(path))
    except (pl.exceptions.PolarsError, OSError, UnicodeDecodeError) as error:
        why = (str(error).splitlines() or [type(error).__name__])[0]
        raise ValueError(f"{path}: cannot be read as a table: {why}") from None
    raise ValueError(f"{path}: expected a .csv, a .parquet or an .mcap file")


def _read_text(path: Path) -> pl.DataFrame:
    """Read a table with a header, its cells apart by commas, semicolons or tabs."""
    skipped = remarks(path)
    with path.open(encoding="utf-8-sig") as lines:
        header, first = [*islice(lines, skipped, skipped + 2), "", ""][:2]
    apart = max(",;\t", key=header.count)
    if all(_numbers_in(header)):
        raise ValueError(
            f"{path}, line {skipped + 1}: numbers where the names of the columns should stand; put "
            "a line with the names before them"
        )
    comma = apart == ";" and bool(re.search(r"\d,\d", first))
    table = pl.read_csv(
        path,
        separator=apart,
        decimal_comma=comma,
        skip_lines=skipped,
        infer_schema_length=None,
        null_values=["", "nan", "NaN", "NAN", "null"],
    )
    table.columns = [name.strip("# \ufeff") for name in table.columns]
    table = table.with_columns(pl.col(pl.String).str.strip_chars())
    for cells in table.select(pl.col(pl.String)):  # numbers after a space
        numbers = cells.cast(pl.Float64, strict=False)
        if numbers.null_count() == cells.null_count():
            table = table.with_columns(numbers)
    return table


def remarks(path: Path) -> int:
    """Return how many lines with #, or empty ones, stand before the header of a text file.

    The header may begin with # itself: it does where a number stands in the line below.
    """
    number = 0
    with path.open(encoding="utf-8-sig") as lines:
        for number, line in enumerate(lines):
            if line.strip() and not line.lstrip().startswith("#"):
                return number - bool(number and any(_numbers_in(line)))
    return number


def _numbers_in(line: str) -> list[bool]:
    cells = line.split(max(",;\t", key=line.count))
    return [bool(re.fullmatch(r'[\s"#]*[-+.\d][-+.,\deE]*[\s"]*', cell)) for cell in cells]
