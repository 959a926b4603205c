"""The error ladder: from the base model down to the noise floor, one rung a model."""

from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robotcast.reporting.numbers import error
from robotcast.reporting.style import BLUE, GREEN, GREY, INK, VERMILION, beside, canvas, hint, style

_ROW, _LABELS = 48.0, 168.0  # pixels
_BARS = {
    "base": {"color": "#8a94a6"},
    "model": {"color": BLUE},
    "open": {"facecolor": "#f8d9c0", "edgecolor": VERMILION, "linestyle": (0, (4, 3))},
}


@dataclass(frozen=True)
class Rung:
    """One model on the ladder.

    Attributes
    ----------
    label, detail : what it is called, and a few words below that.
    realised : its error on held-out trials; None while it is not known.
    standard_error : of `realised`.
    predicted : the error that was expected before the model was refitted.
    kind : "base" without any effect; "model"; "open" for what no named effect explains.
    compared_to : the error that `realised` is a fall from, None where there is none.
    """

    label: str
    realised: float | None
    standard_error: float | None = None
    predicted: float | None = None
    detail: str = ""
    kind: str = "model"
    compared_to: float | None = None


@style(on_page=True)
def ladder(rungs: Sequence[Rung], floor: float | None, axis: str, unit: str = "%") -> Figure:
    """Draw the rungs from top to bottom; errors, `floor` and whiskers in `unit`."""
    figure, axes = canvas(640, 64 + _ROW * len(rungs), _LABELS, 128, 26, 38)
    ends = [(r.realised or 0) + (r.standard_error or 0) for r in rungs]
    most = max(*ends, *(r.predicted or 0 for r in rungs), 1.15 * (floor or 0))
    axes.set(xlim=(0, 1.04 * most or 1), ylim=(len(rungs) - 0.4, -0.4), xlabel=axis, yticks=[])
    axes.spines["bottom"].set_visible(False)
    if floor is not None:
        words = f"noise floor {error(floor, unit)}"
        why = f"{words}: how far repeats lie from each other. No model can do better."
        axes.axvspan(0, floor, color=GREEN, alpha=0.1, lw=0, url=hint(why))
        axes.axvline(floor, ymax=1 + 12 / (_ROW * len(rungs)), color="#007a59", clip_on=False)
        left = floor > 0.5 * most
        looks = {"ha": "right" if left else "left", "color": "#00684b", "weight": "bold"}
        beside(axes, words, floor, -0.4, -6 if left else 6, 6, **looks)
    for row, rung in enumerate(rungs):
        _names(axes, rung, row)
        if rung.realised is not None:
            _bar(axes, rung, row, unit)
        if rung.predicted is not None:
            axes.hlines(row + 0.3, 0, rung.predicted, color=INK, lw=1, ls=(0, (2, 3)))
            axes.plot(rung.predicted, row + 0.3, "D", color=INK, mfc="white", ms=6)
            words = f"predicted {error(rung.predicted, unit)}"
            beside(axes, words, rung.predicted, row + 0.3, 10, -4, size=11, color="#374151")
    return figure


def _names(axes: Axes, rung: Rung, row: int) -> None:
    """Write the label on one line or two, and the detail below it."""
    lines = rung.label.replace(" + ", "\n+ ").split("\n")
    if len(lines) > 2:
        lines = [lines[0], f"{lines[1]} + {len(lines) - 2} more"]
    size, step = (13.5, 16.0) if len(lines) == 1 else (12.5, 13.5)
    for n, line in enumerate(lines):
        beside(axes, line, 0, row, -_LABELS, -5 - step * n, size=size, weight="bold")
    beside(axes, rung.detail, 0, row, -_LABELS, -5 - step * len(lines), size=11, color=GREY)


def _bar(axes: Axes, rung: Rung, row: int, unit: str) -> None:
    value, spread = rung.realised or 0.0, rung.standard_error or 0.0
    words = f"{rung.label}: error {error(value, unit)}"
    if spread:
        words += f", standard error {error(spread, unit)}"
        axes.errorbar(value, row, xerr=[[min(spread, value)], [spread]], color=INK, capsize=4)
    (bar,) = axes.barh(row, value, 0.36, **_BARS[rung.kind])
    bar.set_url(hint(words))
    shown = error(value, unit)
    beside(axes, shown, value + spread, row, 8, -5, size=15, weight="bold")
    if rung.compared_to:
        change = 100 * (value / rung.compared_to - 1)
        fallen = f"{'−' if change < 0 else '+'}{abs(change):.0f} %"
        right = 16 + 9.8 * len(shown)
        beside(axes, fallen, value + spread, row, right, -5, size=11.5, color=GREY)
