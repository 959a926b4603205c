"""How the error grows over time, with the phases of the motion."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup

from robotcast.reporting.comparison.axes import axes
from robotcast.reporting.comparison.plane import upright
from robotcast.reporting.inline_svg import (
    BLUE,
    GREEN,
    INK,
    LINE,
    Scale,
    drawing,
    line,
    nice_top,
    tag,
    text,
)

_WIDTH, _HEIGHT = 760.0, 300.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 52.0, 10.0, 40.0, 40.0
_LETTER = 6.4  # width of a letter of a phase's name


def course_figure(comparison: Mapping[str, Any]) -> Markup:
    """Draw the mean error and its quartiles over time, beside what repeats differ by."""
    course = comparison["over_time"]
    times = course["times_s"]
    step = times[1] - times[0] if len(times) > 1 else 1.0
    across = Scale(times[0], max(times[-1], times[0] + step), _LEFT, _WIDTH - _RIGHT)
    top = nice_top([v for v in (*course["mean"], *course["upper"]) if v is not None])
    up = Scale(0.0, top, _HEIGHT - _BOTTOM, _TOP)
    noise = [math.nan if v is None else v for v in course["noise"]]
    parts = [
        *axes(across, up, "time [s]", (9, 5), 11.0),
        upright(11.0, (up.start + up.end) / 2, f"error [{comparison['error_unit']}]"),
        *_phases(comparison["phases"], across),
        _band(across, up, times, course["lower"], course["upper"]),
        _curve(across, up, times, noise, GREEN, 1.6, "5 4"),
        _curve(across, up, times, course["mean"], BLUE, 2.4),
    ]
    if len(times) == 1:
        parts.append(tag("circle", cx=across(times[0]), cy=up(course["mean"][0]), r=4, fill=BLUE))
    return drawing(_WIDTH, _HEIGHT, "Error over time", *parts)


def _phases(phases: Sequence[Mapping[str, Any]], across: Scale) -> list[Markup]:
    """Mark where phases start, in two rows of names where one would run into the next."""
    parts: list[Markup] = []
    taken = [-math.inf, -math.inf]
    for place, phase in enumerate(phases):
        if not across.low <= phase["start_s"] <= across.high:
            continue
        x = across(phase["start_s"])
        after = [p["start_s"] for p in phases[place + 1 :] if p["start_s"] <= across.high]
        end = across(after[0]) if after else across.end
        if place % 2 == 0:
            parts.append(
                tag(
                    "rect",
                    x=x,
                    y=_TOP,
                    width=end - x,
                    height=_HEIGHT - _BOTTOM - _TOP,
                    fill=INK,
                    fill_opacity=0.035,
                )
            )
        row = 0 if x >= taken[0] else 1
        taken[row] = x + _LETTER * len(phase["name"]) + 8
        y = _TOP - 8 if row == 0 else _TOP - 24
        parts += [
            line(x, y + 3, x, _HEIGHT - _BOTTOM, stroke=LINE),
            text(x + 4, y, phase["name"], font_size=11.5, fill="#374151"),
        ]
    return parts


def _curve(
    across: Scale,
    up: Scale,
    times: Sequence[float],
    values: Sequence[float],
    colour: str,
    width: float,
    dashes: str | None = None,
) -> Markup:
    way, pen = "", "M"
    for t, value in zip(times, values, strict=True):
        if math.isfinite(value):
            way += f"{pen}{across(t):.1f} {up(value):.1f}"
        pen = "L" if math.isfinite(value) else "M"
    return tag(
        "path",
        d=way or "M0 0",
        stroke=colour,
        stroke_width=width,
        fill="none",
        stroke_dasharray=dashes,
        stroke_linejoin="round",
    )


def _band(
    across: Scale, up: Scale, times: Sequence[float], low: Sequence[float], high: Sequence[float]
) -> Markup:
    there = [f"{across(t):.1f} {up(v):.1f}" for t, v in zip(times, high, strict=True)]
    back = [f"{across(t):.1f} {up(v):.1f}" for t, v in zip(times, low, strict=True)]
    return tag("path", d=f"M{'L'.join([*there, *back[::-1]])}Z", fill=BLUE, fill_opacity=0.16)
