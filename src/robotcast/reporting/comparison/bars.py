"""The two errors beside what noise alone makes."""

from collections.abc import Mapping
from typing import Any

from markupsafe import Markup

from robotcast.reporting.comparison.labels import tick_label
from robotcast.reporting.inline_svg import (
    BLUE,
    FAINT,
    SOFT,
    Scale,
    drawing,
    hint,
    line,
    nice_top,
    tag,
    text,
)
from robotcast.reporting.numbers import error

_WIDTH, _LABELS, _VALUES = 600.0, 192.0, 140.0
_BAR, _ROW = 19.0, 70.0
_GREEN = "#5bb899"


def error_bars(comparison: Mapping[str, Any]) -> Markup:
    """Draw the average and the final error as bars, each above its noise floor."""
    words = comparison["words"]
    rows = (
        (
            f"average over {words['samples']}",
            "mean over all",
            comparison["waypoint_error_percent"],
            comparison["noise_floor_percent"],
        ),
        (
            f"last {words['sample']}",
            "median over all",
            comparison["final_error_percent"],
            comparison["noise_floor_final_percent"],
        ),
    )
    top = nice_top([v for _, _, *pair in rows for v in pair if v is not None])
    across = Scale(0.0, top, _LABELS, _WIDTH - _VALUES)
    bottom = 4 + _ROW * len(rows) - 14
    parts: list[Markup] = []
    for tick in across.ticks(5):
        x = across(tick)
        parts.append(line(x, 0, x, bottom, stroke=FAINT))
        parts.append(text(x, bottom + 15, tick_label(tick), "middle", font_size=11, fill=SOFT))
    middle = (across.start + across.end) / 2
    label = f"error [{comparison['error_unit']}]"
    parts.append(text(middle, bottom + 31, label, "middle", font_size=11.5, fill=SOFT))
    for place, (name, how, model, noise) in enumerate(rows):
        parts.append(_row(4 + _ROW * place, name, f"{how} {words['trials']}", model, noise, across))
    return drawing(_WIDTH, bottom + 38, "Errors beside the noise floor", *parts)


def _row(y: float, name: str, how: str, model: float, noise: float | None, across: Scale) -> Markup:
    parts = [
        text(0, y + 16, name, font_size=13.5, font_weight=600),
        text(0, y + 33, how, font_size=11, fill=SOFT),
        _bar(y, model, BLUE, across),
        text(across(model) + 7, y + 14, f"{error(model)} model", font_weight=600),
    ]
    if noise is None:
        return tag(
            "g", *parts, text(across.start + 7, y + _BAR + 16, "noise floor unknown", fill=SOFT)
        )
    words = "how far repeats of one action lie from each other: no model can do better"
    parts += [
        hint(words),
        _bar(y + _BAR + 2, noise, _GREEN, across),
        text(across(noise) + 7, y + _BAR + 16, f"{error(noise)} noise floor", fill="#00684b"),
    ]
    return tag("g", *parts)


def _bar(y: float, value: float, fill: str, across: Scale) -> Markup:
    width = max(across(value) - across.start, 1.5)
    return tag("rect", x=across.start, y=y, width=width, height=_BAR, fill=fill)
