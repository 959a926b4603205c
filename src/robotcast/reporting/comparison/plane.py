"""The frame that paths are drawn in: a plane, or signals over time."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup

from robotcast.reporting.comparison.labels import tick_label
from robotcast.reporting.inline_svg import FAINT, LINE, SOFT, Scale, drawing, line, tag, text

_LEFT, _RIGHT, _TOP, _BOTTOM = 50.0, 8.0, 8.0, 40.0  # room for labels around the frame
_MARGIN = 0.05  # of the range, around what is drawn
_STRAY = 0.01  # of the predicted samples that may fall outside the frame on each side
_TALLEST = 0.86  # height of the frame over its width, at most

TIME = -1


@dataclass(frozen=True)
class Plane:
    """Maps samples to places in a drawing.

    Attributes
    ----------
    lanes : (component across, component up) of every line that a path is drawn as; across is
        TIME for signals over time.
    across_label, up_label : of the axes, with their unit.
    """

    width: float
    height: float
    across: Scale
    up: Scale
    lanes: tuple[tuple[int, int], ...]
    across_label: str
    up_label: str

    def places(self, lane: tuple[int, int], times_s: np.ndarray, path: np.ndarray) -> np.ndarray:
        """Return where the samples of a path (k, d) lie in the drawing, (k, 2)."""
        across = times_s if lane[0] == TIME else path[:, lane[0]]
        return np.stack([self.across(across), self.up(path[:, lane[1]])], axis=1)  # type: ignore

    def framed(self, title: str, *children: Markup) -> Markup:
        """Return the drawing with its axes around the children."""
        return drawing(self.width, self.height, title, self.axes(), *children)

    def axes(self) -> Markup:
        """Draw frame, grid and labels."""
        x0, x1 = sorted((self.across.start, self.across.end))
        y0, y1 = sorted((self.up.start, self.up.end))
        parts = []
        for value in self.across.ticks(6):
            x = self.across(value)
            parts += [
                line(x, y0, x, y1, stroke=FAINT),
                text(x, y1 + 15, tick_label(value), "middle", font_size=11, fill=SOFT),
            ]
        for value in self.up.ticks(5):
            y = self.up(value)
            parts += [
                line(x0, y, x1, y, stroke=FAINT),
                text(x0 - 6, y + 4, tick_label(value), "end", font_size=11, fill=SOFT),
            ]
        parts += [
            tag("rect", x=x0, y=y0, width=x1 - x0, height=y1 - y0, fill="none", stroke=LINE),
            text((x0 + x1) / 2, y1 + 32, self.across_label, "middle", font_size=11.5, fill=SOFT),
            upright(11.0, (y0 + y1) / 2, self.up_label),
        ]
        return tag("g", *parts)


def upright(x: float, y: float, label: str) -> Markup:
    """Return the label of a vertical axis, read from below."""
    turn = f"rotate(-90 {x:.2f} {y:.2f})"
    return text(x, y, label, "middle", font_size=11.5, fill=SOFT, transform=turn)


def in_plane(comparison: Mapping[str, Any]) -> bool:
    """Tell whether the signal is a place in a plane."""
    return len(comparison["words"]["axes"]) == 2


def plane_of(comparison: Mapping[str, Any], width: float) -> Plane:
    """Return the frame that holds every measured path and nearly all of the predicted ones."""
    trials, axes = comparison["trials"], comparison["words"]["axes"]
    bounds = _bounds(trials, len(axes))
    if not in_plane(comparison):
        last_s = max(t["times_s"][-1] for t in trials)
        first_s = min(t["times_s"][0] for t in trials)
        low, high = bounds[:, 0].min(), bounds[:, 1].max()
        height = 0.62 * width
        return Plane(
            width,
            height,
            Scale(first_s, max(last_s, first_s + 1e-9), _LEFT, width - _RIGHT),
            Scale(float(low), float(high), height - _BOTTOM, _TOP),
            tuple((TIME, component) for component in range(len(axes))),
            "time [s]",
            ", ".join(_label(axis) for axis in axes),
        )
    # a board is seen by its robot: the first axis away from it, the second to its left
    away, left = bounds
    per_m = (width - _LEFT - _RIGHT) / (left[1] - left[0])
    per_m = min(per_m, _TALLEST * width / (away[1] - away[0]))
    spare = (width - _LEFT - _RIGHT) / per_m - (left[1] - left[0])
    left = left + np.array([-0.5, 0.5]) * spare
    height = per_m * (away[1] - away[0]) + _TOP + _BOTTOM
    return Plane(
        width,
        float(height),
        Scale(float(left[0]), float(left[1]), width - _RIGHT, _LEFT),
        Scale(float(away[0]), float(away[1]), float(height) - _BOTTOM, _TOP),
        ((1, 0),),
        _label(axes[1]),
        _label(axes[0]),
    )


def _label(axis: Mapping[str, str]) -> str:
    unit = f" [{axis['unit']}]" if axis["unit"] else ""
    return f"{axis['name']}{unit}" + (f", larger {axis['above']}" if axis["above"] else "")


def _bounds(trials: Sequence[Mapping[str, Any]], d: int) -> np.ndarray:
    """Return the range of every component with a margin, (d, 2)."""
    measured = np.concatenate([np.array(t["measured"]) for t in trials])
    low, high = measured.min(axis=0), measured.max(axis=0)
    kept = [np.array(t["predicted"]) for t in trials if not t["diverged"]]
    if kept:
        inner = np.quantile(np.concatenate(kept), (_STRAY, 1 - _STRAY), axis=0)
        low, high = np.minimum(low, inner[0]), np.maximum(high, inner[1])
    span = np.maximum(high - low, 1e-6)
    # a motion along a line still gets a frame with some width
    span = np.maximum(span, 0.2 * span.max()) if d == 2 else span
    middle = (low + high) / 2
    reach = span * (0.5 + _MARGIN)
    return np.stack([middle - reach, middle + reach], axis=1)
