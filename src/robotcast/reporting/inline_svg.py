"""SVG written by hand, so that a page carries drawings whose text can be read and pointed at."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup, escape

INK, SOFT, LINE, FAINT = "#1f2937", "#6b7280", "#d1d5db", "#eef1f5"
BLUE, VERMILION, GREEN, ORANGE = "#0072b2", "#d55e00", "#009e73", "#e69f00"
FONT = "system-ui, 'Segoe UI', 'DejaVu Sans', sans-serif"


def tag(name: str, *children: str, **attributes: object) -> Markup:
    """Return one element; children that are not markup are escaped.

    `stroke_width` is written stroke-width and `class_` class; None leaves an attribute out.
    """
    written = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{escape(_plain(value))}"'
        for key, value in attributes.items()
        if value is not None
    )
    inside = "".join(escape(child) for child in children)
    return Markup(f"<{name}{written}>{inside}</{name}>" if inside else f"<{name}{written}/>")


def drawing(width: float, height: float, title: str, *children: str) -> Markup:
    """Return a whole drawing that scales with the page; `title` is read out to the blind."""
    return tag(
        "svg",
        *children,
        xmlns="http://www.w3.org/2000/svg",
        viewBox=f"0 0 {_plain(width)} {_plain(height)}",
        width=width,
        height=height,
        role="img",
        aria_label=title,
        font_family=FONT,
        font_size=12,
        fill=INK,
    )


def text(x: float, y: float, content: str, anchor: str = "start", **attributes: object) -> Markup:
    """Return text at a point; `anchor` is start, middle or end."""
    anchored = None if anchor == "start" else anchor
    return tag("text", content, x=x, y=y, text_anchor=anchored, **attributes)


def line(x1: float, y1: float, x2: float, y2: float, **attributes: object) -> Markup:
    """Return a line, grey unless told otherwise."""
    return tag("line", x1=x1, y1=y1, x2=x2, y2=y2, **{"stroke": LINE, **attributes})


def hint(content: str) -> Markup:
    """Return what a pointer resting on the surrounding element shows."""
    return tag("title", content)


@dataclass(frozen=True)
class Scale:
    """Maps numbers in [low, high] to places in [start, end]; start may lie beyond end."""

    low: float
    high: float
    start: float
    end: float

    def __call__(self, value: float) -> float:
        share = (value - self.low) / (self.high - self.low)
        return self.start + share * (self.end - self.start)

    def ticks(self, count: int = 5) -> list[float]:
        """Return about `count` round numbers inside the scale."""
        return ticks(self.low, self.high, count)


def ticks(low: float, high: float, count: int = 5) -> list[float]:
    """Return about `count` round numbers from `low` to `high`."""
    rough = (high - low) / max(count, 1)
    power = 10.0 ** math.floor(math.log10(rough))
    step = min((power * s for s in (1, 2, 2.5, 5, 10)), key=lambda s: abs(s - rough))
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    return [round(index * step, 12) for index in range(first, last + 1)]


def nice_top(values: Sequence[float], default: float = 1.0) -> float:
    """Return a round number just above the largest value, for an axis that starts at 0."""
    most = max((v for v in values if math.isfinite(v)), default=0.0)
    if most <= 0:
        return default
    step = ticks(0, most)[1]
    return math.ceil(most * 1.02 / step) * step


def _plain(value: object) -> str:
    """Write numbers short and the same everywhere."""
    return f"{value:.2f}".rstrip("0").rstrip(".") if isinstance(value, float) else str(value)
