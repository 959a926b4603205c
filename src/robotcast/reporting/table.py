"""A table of percentages, and its written forms: Markdown, CSV, LaTeX and cells of a page."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import NamedTuple

import polars as pl

from robotcast.reporting.page import render

MISSING = "–"


def percent(value: float | None) -> str:
    """Return a number in % as tables show it: whole ones as they are, others with one decimal."""
    if value is None:
        return MISSING
    return f"{value}%" if isinstance(value, int) else f"{value:.1f}%"


def markdown(columns: Sequence[str], rows: Sequence[Sequence[object]], labels: int = 99) -> str:
    """Return a table in Markdown; numbers get one decimal, and no zero a minus.

    Parameters
    ----------
    labels : so many columns stand on the left, the others on the right.
    """

    def text(cell: object) -> str:
        return f"{cell:z.1f}" if isinstance(cell, float) else str(cell)

    rule = ["---" if n < labels else "---:" for n in range(len(columns))]
    lines = [columns, rule, *([text(c) for c in row] for row in rows)]
    return "".join("| " + " | ".join(line) + " |\n" for line in lines)


class Cell(NamedTuple):
    """A number as it is shown; the best is bold. `kind` : its CSS classes."""

    text: str
    best: bool
    kind: str


@dataclass(frozen=True)
class Group:
    """Neighbouring columns under one heading; of a `contest`, the least of each is the best."""

    title: str
    columns: tuple[str, ...]
    contest: bool = False


@dataclass(frozen=True)
class Table:
    """A table with a caption, ready to be written.

    Attributes
    ----------
    name : stem of its files and its LaTeX label.
    label_columns : headings of the labels that a row begins with.
    rows : labels, then a number for every column of every group: in % of cable length, None when
        it was not run.
    reference : index of the first group that is not this run's own, for shading.
    contests : row → with which others it contends for the best; None with none.
    """

    name: str
    caption: str
    label_columns: tuple[str, ...]
    groups: tuple[Group, ...]
    rows: tuple[tuple, ...]
    reference: int
    contests: tuple[str | None, ...] = ()

    @property
    def written(self) -> list[tuple[Sequence[str], list[Cell]]]:
        """Labels and cells, row by row."""
        columns, at = [], len(self.label_columns)
        for index, group in enumerate(self.groups):
            for first, _ in enumerate(group.columns):
                kind = " ".join(["paper"] * (index >= self.reference) + ["first"] * (first == 0))
                values = [row[at] for row in self.rows]
                best = self._best(values) if group.contest else [False] * len(values)
                columns.append(
                    [Cell(percent(v), b, kind) for v, b in zip(values, best, strict=True)]
                )
                at += 1
        labels = [row[: len(self.label_columns)] for row in self.rows]
        return list(zip(labels, map(list, zip(*columns, strict=True)), strict=True))

    def _best(self, values: Sequence[float | None]) -> list[bool]:
        """Tell of each value whether none is lower, as they are shown, in a contest of several."""
        shown = [None if v is None else round(v, 1) for v in values]
        pairs = list(zip(shown, self.contests, strict=True))

        def wins(value: float | None, contest: str | None) -> bool:
            rivals = [v for v, c in pairs if c == contest and v is not None]
            return contest is not None and len(rivals) > 1 and value == min(rivals)

        return [wins(*pair) for pair in pairs]

    @property
    def _columns(self) -> list[str]:
        return [f"{g.title}: {c}" for g in self.groups for c in g.columns]

    def markdown(self) -> str:
        """Write as a Markdown table; a column's heading names its group."""
        rows = [
            (*labels, *(f"**{c.text}**" if c.best else c.text for c in cells))
            for labels, cells in self.written
        ]
        n = len(self.label_columns)
        return f"{markdown((*self.label_columns, *self._columns), rows, n)}\n{self.caption}\n"

    def csv(self) -> str:
        """Write plain numbers in % of cable length, empty where nothing was run."""
        names = [f"{column} [% of cable length]" for column in self._columns]
        frame = pl.DataFrame(
            self.rows, [*self.label_columns, *names], orient="row", infer_schema_length=None
        )
        return frame.write_csv(float_precision=3)

    def latex(self) -> str:
        """Write a table environment that shrinks to the text's width where it is wider.

        It needs \\usepackage{booktabs,graphicx}.
        """
        ends = [*accumulate((len(g.columns) for g in self.groups), initial=len(self.label_columns))]
        return render(
            "table.tex",
            name=self.name,
            caption=self.caption,
            labels=self.label_columns,
            groups=self.groups,
            columns=tuple(c for g in self.groups for c in g.columns),
            spans=[(low + 1, high) for low, high in pairwise(ends)],
            rows=self.written,
        )
