"""The report as one HTML file that needs nothing else."""

import base64
import re
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup, escape

from robotcast.reporting.table import Cell, Row, Table

_SYMBOLS = {
    "π_R2S2R": "<i>π</i><sub>R2S2R</sub>",
    "π_RD": "<i>π</i><sub>RD</sub>",
    "π_SD": "<i>π</i><sub>SD</sub>",
    "D_real": "<i>D</i><sub>real</sub>",
    "D_sim": "<i>D</i><sub>sim</sub>",
    "Q1": "Q<sub>1</sub>",
    "Q3": "Q<sub>3</sub>",
}


@dataclass(frozen=True)
class PageFigure:
    """A figure as the page shows it and as it lies in figures/."""

    name: str
    title: str
    caption: str
    svg: bytes


@dataclass(frozen=True)
class Section:
    """One question the page answers."""

    title: str
    text: str
    table: Table | None
    figures: tuple[PageFigure, ...]


@dataclass(frozen=True)
class Glance:
    """A small table of facts, a row a cable."""

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str


@dataclass(frozen=True)
class Page:
    """What the page says, from top to bottom.

    Attributes
    ----------
    warnings : what a reader must know before any number.
    run, commands : (name, text) pairs.
    """

    lead: str
    warnings: tuple[str, ...]
    glance: Glance
    sections: tuple[Section, ...]
    run: tuple[tuple[str, str], ...]
    commands: tuple[tuple[str, str], ...]

    def html(self) -> str:
        """Write the page with its style and figures inside."""
        template_folder = files("robotcast.reporting") / "template"
        environment = Environment(
            autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
        )
        environment.filters["base64"] = lambda content: base64.b64encode(content).decode()
        environment.filters["symbols"] = _with_symbols
        environment.filters["cells"] = _cells
        template = environment.from_string((template_folder / "page.html").read_text("utf-8"))
        css = Markup((template_folder / "page.css").read_text("utf-8"))
        return template.render(css=css, **vars(self))


def _with_symbols(text: str) -> Markup:
    pattern = "|".join(sorted(_SYMBOLS, key=len, reverse=True))
    return Markup(re.sub(pattern, lambda found: _SYMBOLS[found[0]], str(escape(text))))


def _cells(table: Table, row: Row) -> Sequence[tuple[str, Cell]]:
    """Pair every cell with its CSS classes."""
    pairs, at = [], 0
    for index, group in enumerate(table.groups):
        for column in range(len(group.columns)):
            kinds = ["paper"] if index >= table.reference else []
            kinds += ["first"] if column == 0 else []
            pairs.append((" ".join(kinds), row.cells[at]))
            at += 1
    return pairs
