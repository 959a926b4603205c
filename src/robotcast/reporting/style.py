"""How every figure looks, and how it is written so that the same results give the same bytes.

Last, errors as bars: the ladder of models down to the noise floor, and any errors side by side.
"""

import io
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap
from typing import Any, Literal

import matplotlib.style
import numpy as np
from markupsafe import Markup, escape
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.quiver import Quiver
from matplotlib.ticker import FixedLocator, NullLocator

from robotcast.reporting.names import error

# Okabe and Ito's palette, told apart by colour-blind readers
BLACK, ORANGE, GREEN, BLUE, VERMILION = "#000000", "#E69F00", "#009E73", "#0072B2", "#D55E00"
CYCLE = (BLUE, VERMILION, GREEN, "#CC79A7", ORANGE, "#56B4E9", BLACK)
GREY, INK, LINE = "#6b7280", "#1f2937", "#d1d5db"

_STYLES = [Path(__file__).parent / "template" / f"{of}.mplstyle" for of in ("figure", "page")]
_LEVELS = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200)  # errors, % of cable length
_TALLEST = 0.86  # height of a board over its width, at most
_NEEDLESS = r'<(metadata|style).*?</\1>|<!--.*?-->| xmlns(:xlink)?="[^"]*"| id="[A-Za-z0-9.]+_\d+"'


@contextmanager
def style(*, on_page: bool = False) -> Iterator[None]:
    """Draw with these settings and no others: a figure of its own, or one that a page holds."""
    with matplotlib.style.context([*_STYLES[: 1 + on_page]], after_reset=True):
        yield


def canvas(
    width: float, height: float, left: float, right: float, top: float, bottom: float
) -> tuple[Figure, Axes]:
    """Return a figure for a page, and its axes within margins; all in pixels, like its letters."""
    figure = Figure(figsize=(width / 72, height / 72), dpi=72)
    inside = ((width - left - right) / width, (height - top - bottom) / height)
    return figure, figure.add_axes((left / width, bottom / height, *inside))


def board_canvas(
    low: np.ndarray, high: np.ndarray, width: float, labels: Sequence[str], above: float = 8
) -> tuple[Figure, Axes]:
    """Return a page's figure of the board from `low` to `high` (2,), x upwards and y to the left.

    `labels` are those of x and y; `above` is left free above it [pixel].
    """
    (far, wide), inside = high - low, width - 58
    tall = min(far / wide, _TALLEST) * inside
    spare = (far * inside / tall - wide) / 2  # a high board gets empty sides
    figure, axes = canvas(width, tall + above + 42, 50, 8, above, 42)
    axes.set(xlim=(high[1] + spare, low[1] - spare), ylim=(low[0], high[0]))
    axes.set(xlabel=labels[1], ylabel=labels[0])
    axes.spines[["top", "right"]].set_visible(True)
    return figure, axes


def beside(
    axes: Axes, text: str, x: float, y: float, right: float, up: float, **looks: Any
) -> None:
    """Write text so many pixels to the right of a place and above it, inside the axes or not."""
    axes.annotate(
        text, (x, y), (right, up), textcoords="offset points", annotation_clip=False, **looks
    )


def svg(figure: Figure) -> str:
    """Return the figure as SVG without date, version or random ids."""
    with style(), io.StringIO() as buffer:
        figure.draw_without_rendering()  # a first layout, which equal aspects then change
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
        return buffer.getvalue()


def inline(figure: Figure, title: str) -> Markup:
    """Return the figure as an element of a page, its letters as text; `title` is read aloud.

    An artist whose URL is `hint(…)` shows it to a resting pointer.
    """
    with style(on_page=True), io.StringIO() as buffer:
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
        text = buffer.getvalue()
    text = re.sub(_NEEDLESS, "", text[text.index("<svg") :], flags=re.S)
    text = re.sub(r'(width|height)="([\d.]+)pt"', r'\1="\2"', text)
    text = re.sub(r'<a xlink:href="hint:(\d*)\|([^"]*)"[^>]*>', _hinted, text)
    text = text.replace("</a>", "</g>")
    looks = f'role="img" aria-label="{escape(title)}" stroke-linejoin="round"'
    return Markup(text.replace("<svg", f"<svg {looks}", 1))


def hint(text: str, trial: int | None = None) -> str:
    """Return the URL by which `inline` gives an artist a hint, and the trial that a click picks."""
    return f"hint:{'' if trial is None else trial}|{text}"


def _hinted(found: re.Match[str]) -> str:
    trial, words = found.groups()
    pick = f' class="pick" data-trial="{trial}"' if trial else ""
    return f"<g{pick}><title>{words}</title>"


def board_axes(axes: Axes) -> None:
    """Label axes as the camera sees the board: x away from the robot upwards, y to the left."""
    axes.set_aspect("equal")
    if not axes.xaxis_inverted():
        axes.invert_xaxis()
    axes.set_xlabel("y [m], left of the robot")
    axes.set_ylabel("x [m], away from the robot")


def board_arrows(
    axes: Axes, tails: np.ndarray, ways: np.ndarray, colors: Any, scale: float = 1.0
) -> Quiver:
    """Draw arrows on a board from `tails` (n, 2) by `ways` (n, 2), `scale` of them to a metre."""
    looks = {"angles": "xy", "scale_units": "xy", "scale": scale, "units": "dots", "width": 1.8}
    heads = {"headwidth": 5, "headlength": 5, "headaxislength": 4, "minlength": 0.6, "zorder": 3}
    sides = (tails[:, 1], tails[:, 0], ways[:, 1], ways[:, 0])
    return axes.quiver(*sides, color=colors, **looks, **heads)


def fit_height(figure: Figure, around_in: float) -> None:
    """Make the figure as high as its grid of boards needs, with no empty bands.

    `around_in` : height of titles, labels and legend [inch], of every row.
    """
    panel, grid = figure.axes[0], figure.axes[0].get_subplotspec()
    rows, columns = grid.get_gridspec().get_geometry() if grid else (1, 1)
    (left, right), (low, high) = panel.get_xlim(), panel.get_ylim()
    wide = figure.get_figwidth() / columns - 0.5
    height = float(np.clip(wide * (high - low) / abs(right - left), 1.2, 6.0))
    figure.set_figheight(rows * (height + around_in))


def log_marks(axis: Axis, levels: Sequence[float] = _LEVELS) -> None:
    """Mark a logarithmic axis with round numbers alone."""
    axis.set_major_locator(FixedLocator(list(levels)))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(lambda value, _: f"{value:g}")


_THICK, _APART, _LINE = 17.0, 19.0, 13.5  # pixels: a bar, from bar to bar, from line to line
_LETTER = 7.0  # pixels, of a bold name
_LOOKS: dict[str, dict[str, Any]] = {
    "before": {"color": "#8a94a6"},
    "model": {"color": BLUE},
    "noise": {"color": "#5bb899"},
    "open": {"facecolor": "#f8d9c0", "edgecolor": VERMILION, "linestyle": (0, (4, 3))},
}


@dataclass(frozen=True)
class Bar:
    """One error; None while it is not known."""

    error: float | None
    # before anything was added; a model; noise; open: what no effect explains
    kind: Literal["before", "model", "noise", "open"] = "model"
    note: str = ""  # a few words on its right
    interval: tuple[float, float] | None = None  # drawn as a whisker
    predicted: float | None = None  # before the model was refitted


@dataclass(frozen=True)
class Row:
    """Bars under one name, with a few words below it."""

    name: str
    bars: tuple[Bar, ...]
    detail: str = ""


def spread(middle: float | None, standard_error: float | None) -> tuple[float, float] | None:
    """Return the interval of one standard error about an error, which is not below 0."""
    if middle is None or standard_error is None:
        return None
    return max(middle - standard_error, 0.0), middle + standard_error


def fall(before: float | None, after: float | None) -> str:
    """Return by how much an error changed: 3.12, 1.04 → −67 %."""
    if not before or after is None:
        return ""
    change = 100 * (after / before - 1)
    return f"{'−' if change < 0 else '+'}{abs(change):.0f} %"


@style(on_page=True)
def bars(
    rows: Sequence[Row],
    axis: str = "",
    floor: float | None = None,
    unit: str = "%",
    width: float = 640,
    names: float = 168,
) -> Figure:
    """Draw rows from top to bottom, each error written in a column of its own on the right.

    The errors' axis has the label `axis`, none without one; the noise `floor` is in `unit` as the
    errors are. `width` and `names`: of the figure and of the column of names [pixel].
    """
    heights = [
        max(12 + _APART * len(r.bars), 15 + _LINE * (len(_lines(r.name, names)) + bool(r.detail)))
        for r in rows
    ]
    above, below = 26 * (floor is not None) or 2, 38 * bool(axis)
    figure, axes = canvas(width, above + sum(heights) + below, names, 136, above, below)
    drawn = [bar for row in rows for bar in row.bars]
    ends = [end for b in drawn for end in (b.error, b.predicted, *(b.interval or ())) if end]
    most = max([0.0, *ends, 1.15 * (floor or 0)])
    axes.set(xlim=(0, 1.04 * most or 1), ylim=(sum(heights), 0), yticks=[], xlabel=axis)
    axes.spines["bottom"].set_visible(False)
    if not axis:
        axes.set_xticks([])
    if floor is not None:
        _floor(axes, floor, unit, left=floor > 0.5 * most)
    top = 0.0
    for row, height in zip(rows, heights, strict=True):
        _name(axes, row, top, names)
        for n, bar in enumerate(row.bars):
            _bar(axes, row, bar, top + 4 + _APART * n + _THICK / 2, unit)
        top += height
    return figure


def _floor(axes: Axes, floor: float, unit: str, left: bool) -> None:
    words = f"noise floor {error(floor, unit)}"
    axes.axvspan(0, floor, color=GREEN, alpha=0.1, lw=0, url=hint(words))
    above = 1 + 12 / axes.get_ylim()[0]
    axes.axvline(floor, ymax=above, color="#007a59", clip_on=False)
    looks = {"ha": "right" if left else "left", "color": "#00684b", "weight": "bold"}
    beside(axes, words, floor, 0, -6 if left else 6, 6, **looks)


def _lines(name: str, width: float) -> list[str]:
    """Return a name as lines that fit into so many pixels."""
    parts = name.replace(" + ", "\n+ ").split("\n")
    parts = parts if len(parts) < 3 else [parts[0], f"{parts[1]} + {len(parts) - 2} more"]
    return [line for part in parts for line in wrap(part, int(width / _LETTER))]


def _name(axes: Axes, row: Row, top: float, names: float) -> None:
    """Write the name on as many lines as it needs, and the detail below it."""
    lines = _lines(row.name, names)
    for n, line in enumerate(lines):
        beside(axes, line, 0, top, -names, -_LINE * (n + 1) - 2, size=12.5, weight="bold")
    down = -_LINE * (len(lines) + 1) - 1
    beside(axes, row.detail, 0, top, -names, down, size=11, color=GREY)


def _bar(axes: Axes, row: Row, bar: Bar, y: float, unit: str) -> None:
    right: Any = {"xycoords": axes.get_yaxis_transform()}  # of the axes, where nothing crosses it
    if bar.error is not None:
        shown, words = error(bar.error, unit), f"{row.name}: error {error(bar.error, unit)}"
        if bar.interval is not None:
            low, high = bar.interval
            words += f", from {error(low, unit)} to {error(high, unit)}"
            reach = [[bar.error - low], [high - bar.error]]
            axes.errorbar(bar.error, y, xerr=reach, color=INK, capsize=4)
        (drawn,) = axes.barh(y, bar.error, _THICK, **_LOOKS[bar.kind])
        drawn.set_url(hint(words))
        size, weight = (12, "normal") if len(row.bars) > 1 else (14, "bold")
        beside(axes, shown, 1, y, 10, -5, size=size, weight=weight, **right)
        beside(axes, bar.note, 1, y, 16 + 0.66 * size * len(shown), -5, color=GREY, **right)
    if bar.predicted is not None:
        lower = y + 0.6 * _THICK
        axes.hlines(lower, 0, bar.predicted, color=INK, lw=1, ls=(0, (2, 3)))
        axes.plot(bar.predicted, lower, "D", color=INK, mfc="white", ms=6)
        words = f"predicted {error(bar.predicted, unit)}"
        beside(axes, words, 1, y, 10, -19, size=10.5, color="#374151", **right)
