"""Errors as bars: the ladder of models down to the noise floor, and any errors side by side."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robotcast.reporting.names import error
from robotcast.reporting.style import BLUE, GREEN, GREY, INK, VERMILION, beside, canvas, hint, style

_THICK, _APART, _LINE = 17.0, 19.0, 13.5  # pixels: a bar, from bar to bar, from line to line
_LOOKS: dict[str, dict[str, Any]] = {
    "before": {"color": "#8a94a6"},
    "model": {"color": BLUE},
    "noise": {"color": "#5bb899"},
    "open": {"facecolor": "#f8d9c0", "edgecolor": VERMILION, "linestyle": (0, (4, 3))},
}


@dataclass(frozen=True)
class Bar:
    """One error; None while it is not known.

    Attributes
    ----------
    kind : "before" anything was added; a "model"; "noise"; "open" for what no effect explains.
    note : a few words on its right.
    interval : between what the error lies, drawn as a whisker.
    predicted : the error that was expected before the model was refitted.
    """

    error: float | None
    kind: Literal["before", "model", "noise", "open"] = "model"
    note: str = ""
    interval: tuple[float, float] | None = None
    predicted: float | None = None

    @property
    def end(self) -> float:
        """How far it reaches with its whisker."""
        return max(self.error or 0, self.predicted or 0, *(self.interval or (0,)))


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

    Parameters
    ----------
    axis : label of the errors' axis; empty without one.
    floor : the noise floor, in `unit` as the errors are.
    width, names : of the figure and of the column of names [pixel].
    """
    heights = [
        max(12 + _APART * len(r.bars), 15 + _LINE * (len(_lines(r.name)) + bool(r.detail)))
        for r in rows
    ]
    above, below = 26 * (floor is not None) or 2, 38 * bool(axis)
    figure, axes = canvas(width, above + sum(heights) + below, names, 136, above, below)
    most = max([0.0, *(bar.end for row in rows for bar in row.bars), 1.15 * (floor or 0)])
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
    why = f"{words}: no model can do better."
    axes.axvspan(0, floor, color=GREEN, alpha=0.1, lw=0, url=hint(why))
    above = 1 + 12 / axes.get_ylim()[0]
    axes.axvline(floor, ymax=above, color="#007a59", clip_on=False)
    looks = {"ha": "right" if left else "left", "color": "#00684b", "weight": "bold"}
    beside(axes, words, floor, 0, -6 if left else 6, 6, **looks)


def _lines(name: str) -> list[str]:
    lines = name.replace(" + ", "\n+ ").split("\n")
    return lines if len(lines) < 3 else [lines[0], f"{lines[1]} + {len(lines) - 2} more"]


def _name(axes: Axes, row: Row, top: float, names: float) -> None:
    """Write the name on one line or two, and the detail below it."""
    lines = _lines(row.name)
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
