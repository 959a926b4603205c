"""The error ladder: from the base model down to the noise floor, one rung a model."""

from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup

from robotcast.reporting.inline_svg import (
    BLUE,
    FAINT,
    INK,
    LINE,
    SOFT,
    VERMILION,
    Scale,
    drawing,
    hint,
    line,
    nice_top,
    tag,
    text,
)
from robotcast.reporting.numbers import error

_ROW, _BAR, _TOP = 48.0, 17.0, 34.0
_LABELS, _VALUES = 168.0, 128.0
_BASE, _OPEN = "#8a94a6", "#f8d9c0"


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

    @property
    def furthest(self) -> float:
        """The largest error that must fit into the drawing."""
        return max((self.realised or 0.0) + (self.standard_error or 0.0), self.predicted or 0.0)


def ladder(
    rungs: Sequence[Rung],
    floor: float | None,
    unit: str = "%",
    axis: str = "average error on held-out casts [% of cable length]",
    width: float = 640.0,
) -> Markup:
    """Draw the rungs from top to bottom; errors, `floor` and whiskers in `unit`."""
    top = nice_top([*(r.furthest for r in rungs), (floor or 0.0) * 1.15])
    across = Scale(0.0, top, _LABELS, width - _VALUES)
    bottom = _TOP + _ROW * len(rungs)
    parts = [_axis(across, bottom, axis)]
    if floor is not None:
        parts.append(_floor(across, floor, unit, bottom))
    for place, rung in enumerate(rungs):
        parts.append(_rung(rung, across, _TOP + _ROW * place, unit))
    return drawing(width, bottom + 38, f"Error ladder of {len(rungs)} models", *parts)


def _axis(across: Scale, bottom: float, label: str) -> Markup:
    ticks = across.ticks(6)
    parts = [line(across(t), _TOP - 8, across(t), bottom, stroke=FAINT) for t in ticks]
    parts += [
        text(across(t), bottom + 15, f"{t:g}", "middle", font_size=11, fill=SOFT) for t in ticks
    ]
    middle = (across.start + across.end) / 2
    parts.append(text(middle, bottom + 31, label, "middle", font_size=11.5, fill=SOFT))
    return tag("g", *parts)


def _floor(across: Scale, floor: float, unit: str, bottom: float) -> Markup:
    at = across(floor)
    label = f"noise floor {error(floor, unit)}"
    right = at < (across.start + across.end) / 2
    return tag(
        "g",
        hint(f"{label}: how far repeats lie from each other. No model can do better."),
        tag(
            "rect",
            x=across.start,
            y=_TOP - 8,
            width=at - across.start,
            height=bottom - _TOP + 8,
            fill="#009e73",
            fill_opacity=0.1,
        ),
        line(at, _TOP - 22, at, bottom, stroke="#007a59", stroke_width=1.5),
        text(
            at + 6 if right else at - 6,
            _TOP - 14,
            label,
            "start" if right else "end",
            fill="#00684b",
            font_weight=600,
        ),
    )


def _rung(rung: Rung, across: Scale, y: float, unit: str) -> Markup:
    parts = [
        hint(_words(rung, unit)),
        *_names(rung, y),
        line(across.start, y - 6, across.start, y + _ROW - 8, stroke=LINE),
    ]
    if rung.realised is not None:
        parts.append(_bar(rung, across, y, unit))
    if rung.predicted is not None:
        parts.append(_predicted(rung.predicted, across, y + _BAR + 11, unit))
    return tag("g", *parts)


def _names(rung: Rung, y: float) -> list[Markup]:
    """Write the label on one line or two, and the detail below it."""
    rows = rung.label.replace(" + ", "\n+ ").split("\n")
    if len(rows) > 2:
        rows = [rows[0], f"{rows[1]} + {len(rows) - 2} more"]
    size = 13.5 if len(rows) == 1 else 12.5
    step = 16.0 if len(rows) == 1 else 13.5
    labels = [
        text(0, y + 13 + step * n, row, font_size=size, font_weight=600)
        for n, row in enumerate(rows)
    ]
    below = y + 13 + step * len(rows)
    return [*labels, text(0, below, rung.detail, font_size=11, fill=SOFT)]


def _bar(rung: Rung, across: Scale, y: float, unit: str) -> Markup:
    value, spread = rung.realised or 0.0, rung.standard_error or 0.0
    middle = y + _BAR / 2
    low, high = across(max(value - spread, 0.0)), across(value + spread)
    fill, stroke = {"base": (_BASE, None), "open": (_OPEN, VERMILION)}.get(rung.kind, (BLUE, None))
    width = max(across(value) - across.start, 1.0)
    parts = [
        tag(
            "rect",
            x=across.start,
            y=y,
            width=width,
            height=_BAR,
            fill=fill,
            stroke=stroke,
            stroke_dasharray="4 3" if stroke else None,
        )
    ]
    if spread:
        parts += [
            line(low, middle, high, middle, stroke=INK, stroke_width=1.4),
            line(low, middle - 4, low, middle + 4, stroke=INK, stroke_width=1.4),
            line(high, middle - 4, high, middle + 4, stroke=INK, stroke_width=1.4),
        ]
    shown = [error(value, unit)]
    if rung.compared_to:
        change = 100 * (value / rung.compared_to - 1)
        fallen = f"{'−' if change < 0 else '+'}{abs(change):.0f} %"
        shown.append(tag("tspan", fallen, dx=8, font_size=11.5, font_weight=400, fill=SOFT))
    parts.append(tag("text", *shown, x=high + 8, y=middle + 5, font_size=15, font_weight=700))
    return tag("g", *parts)


def _predicted(predicted: float, across: Scale, y: float, unit: str) -> Markup:
    at = across(predicted)
    return tag(
        "g",
        line(across.start, y, at - 5, y, stroke=INK, stroke_width=1, stroke_dasharray="2 3"),
        tag("path", d=f"M{at - 5:.1f} {y:.1f}l5 -5l5 5l-5 5z", fill="#fff", stroke=INK),
        text(at + 10, y + 4, f"predicted {error(predicted, unit)}", font_size=11, fill="#374151"),
    )


def _words(rung: Rung, unit: str) -> str:
    known = [f"error {error(rung.realised, unit)}"] if rung.realised is not None else []
    if rung.standard_error:
        known.append(f"standard error {error(rung.standard_error, unit)}")
    if rung.predicted is not None:
        known.append(f"predicted {error(rung.predicted, unit)}")
    return ": ".join([rung.label, ", ".join(known) or "not known yet"])
