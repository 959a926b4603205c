"""The error against every number of the action, one small panel each."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from robotcast.reporting.comparison.axes import axes
from robotcast.reporting.comparison.labels import factor_label
from robotcast.reporting.inline_svg import (
    BLUE,
    SOFT,
    VERMILION,
    Scale,
    drawing,
    hint,
    nice_top,
    tag,
)
from robotcast.reporting.numbers import error

_WIDTH, _HEIGHT = 232.0, 186.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 34.0, 10.0, 12.0, 36.0
_TALL = 2.0  # times the error that nine trials in ten stay below: higher points are cut off


def factor_figures(comparison: Mapping[str, Any]) -> list[Markup]:
    """Draw one panel a factor, all with the same error axis."""
    top = _top([t["waypoint_percent"] for t in comparison["trials"]])
    return [_panel(comparison, name, top) for name in comparison["factors"]]


def _top(errors: Sequence[float]) -> float:
    usual = float(np.quantile(errors, 0.9))
    return nice_top([min(max(errors), _TALL * usual)])


def _panel(comparison: Mapping[str, Any], name: str, top: float) -> Markup:
    trend, unit = comparison["factors"][name], comparison["words"]["factor_units"].get(name, "")
    low, high = min(trend["values"]), max(trend["values"])
    margin = 0.04 * (high - low)
    across = Scale(low - margin, high + margin, _LEFT, _WIDTH - _RIGHT)
    up = Scale(0.0, top, _HEIGHT - _BOTTOM, _TOP)
    running = zip(trend["running_values"], trend["running_median"], strict=True)
    way = "L".join(f"{across(v):.1f} {up(min(e, top)):.1f}" for v, e in running)
    parts = [
        *axes(across, up, factor_label(name, unit), (4, 4), 10.5),
        *_points(comparison, trend, across, up),
    ]
    if way:
        parts.append(
            tag(
                "path",
                d=f"M{way}",
                stroke=BLUE,
                stroke_width=2.4,
                fill="none",
                stroke_linejoin="round",
            )
        )
    return drawing(_WIDTH, _HEIGHT, f"Error against {name}", *parts)


def _points(
    comparison: Mapping[str, Any], trend: Mapping[str, Any], across: Scale, up: Scale
) -> list[Markup]:
    """Draw every trial; one beyond the axis as a triangle at its upper edge."""
    word, drawn = comparison["words"]["trial"], []
    for some, value, percent in zip(
        comparison["trials"], trend["values"], trend["errors"], strict=True
    ):
        x, y = across(value), up(min(percent, up.high))
        words = hint(f"{word} {some['trial']}: {error(percent)}")
        kind = {"class_": "pick", "data_trial": some["trial"]}
        if percent > up.high:
            way = f"M{x:.1f} {y - 5:.1f}l5 9h-10z"
            drawn.append(tag("path", words, d=way, fill=VERMILION, **kind))
        else:
            drawn.append(
                tag("circle", words, cx=x, cy=y, r=3.2, fill=SOFT, fill_opacity=0.6, **kind)
            )
    return drawn
