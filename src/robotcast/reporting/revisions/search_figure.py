"""How a search goes: the best error so far against the casts simulated for it."""

import math
from collections.abc import Mapping, Sequence

from markupsafe import Markup

from robotcast.reporting.inline_svg import (
    BLUE,
    FAINT,
    GREEN,
    LINE,
    SOFT,
    Scale,
    drawing,
    line,
    tag,
    text,
)
from robotcast.reporting.names import thousands
from robotcast.reporting.numbers import error
from robotcast.tuning.search import Batch

_WIDTH, _HEIGHT, _LEFT, _RIGHT, _TOP, _BOTTOM = 480.0, 260.0, 52.0, 62.0, 14.0, 46.0
_ROUND = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200)


def search_figure(
    trace: Sequence[Batch], marks: Mapping[str, float], floor: float | None
) -> Markup:
    """Draw the best error so far, on a logarithmic axis.

    Parameters
    ----------
    marks : what other revisions ended with on the same casts, name → error in %.
    floor : noise floor in %.
    """
    best = [batch.best_percent for batch in trace]
    levels = [v for v in (*best, *marks.values(), floor) if v is not None and v > 0]
    low, high = math.log10(min(levels) / 1.25), math.log10(max(levels) * 1.15)
    up = Scale(low, high, _HEIGHT - _BOTTOM, _TOP)
    done = [0]
    for batch in trace:
        done.append(done[-1] + batch.casts)
    across = Scale(0.0, float(done[-1]), _LEFT, _WIDTH - _RIGHT)
    parts = [*_axes(across, up)]
    for name, level in marks.items():
        parts.append(_level(up(math.log10(level)), f"{name} {error(level)}", SOFT, across, -4))
    if floor:
        parts.append(_level(up(math.log10(floor)), "noise floor", GREEN, across, 13))
    parts.append(_steps(done, best, across, up))
    return drawing(_WIDTH, _HEIGHT, "The best error so far", *parts)


def _axes(across: Scale, up: Scale) -> list[Markup]:
    parts = []
    for tick in (t for t in _ROUND if up.low <= math.log10(t) <= up.high):
        y = up(math.log10(tick))
        parts += [
            line(across.start, y, across.end, y, stroke=FAINT),
            text(across.start - 7, y + 4, f"{tick:g}", "end", font_size=11, fill=SOFT),
        ]
    for tick in across.ticks(4):
        parts.append(
            text(across(tick), up.start + 16, thousands(tick), "middle", font_size=11, fill=SOFT)
        )
    middle, centre = (across.start + across.end) / 2, (up.start + up.end) / 2
    return [
        *parts,
        line(across.start, up.start, across.end, up.start, stroke=LINE),
        text(middle, up.start + 36, "simulated casts", "middle", fill=SOFT),
        text(
            13,
            centre,
            "best error on tuning casts [%]",
            "middle",
            fill=SOFT,
            transform=f"rotate(-90 13 {centre:.1f})",
        ),
    ]


def _level(y: float, words: str, colour: str, across: Scale, below: float) -> Markup:
    return tag(
        "g",
        line(across.start, y, across.end, y, stroke=colour, stroke_dasharray="3 4"),
        text(across.end - 4, y + below, words, "end", font_size=11, fill=colour),
    )


def _steps(done: Sequence[int], best: Sequence[float], across: Scale, up: Scale) -> Markup:
    """Draw the curve: each batch is known when its casts are through."""
    path, y = "", 0.0
    for casts, value in zip(done[1:], best, strict=True):
        x = across(casts)
        y = up(math.log10(value))
        path += f"H{x:.1f}V{y:.1f}" if path else f"M{x:.1f} {y:.1f}"
    return tag(
        "g",
        tag("path", d=path, fill="none", stroke=BLUE, stroke_width=2.2),
        tag("circle", cx=across.end, cy=y, r=4, fill=BLUE),
        text(across.end + 8, y + 4, error(best[-1]), font_weight=700, fill=BLUE),
    )
