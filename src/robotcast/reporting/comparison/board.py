"""Where on the board a model errs: arrows from measured to predicted."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from markupsafe import Markup

from robotcast.reporting.comparison.colours import SHADES, Shading
from robotcast.reporting.comparison.plane import Plane, plane_of
from robotcast.reporting.inline_svg import INK, hint, tag, ticks
from robotcast.reporting.numbers import error

When = Literal["moving", "rest"]

_WIDTH = 540.0
_RESTING = 0.01  # of scale: closer than this to where it ends, the signal rests
_CELLS = 14  # across the wider side of the board
_FEWEST = 3  # trials in a cell before their mean is drawn


@dataclass(frozen=True)
class _Arrows:
    """Errors at many places; rows of `start` and `end` (n, 2) belong to `trial` (n,)."""

    trial: np.ndarray
    start: np.ndarray
    end: np.ndarray
    percent: np.ndarray


def residual_map(comparison: Mapping[str, Any], when: When) -> tuple[Markup, Markup]:
    """Draw the errors of all trials, while the signal moves or where it ends, and their legend."""
    plane = plane_of(comparison, _WIDTH)
    arrows = _arrows(comparison, when)
    shading = Shading.of(
        [e for t in comparison["trials"] if not t["diverged"] for e in t["errors_percent"]]
    )
    if when == "moving":
        parts = [*_lines(plane, arrows, shading), *_mean_arrows(plane, arrows)]
        title = "Errors while it moves"
    else:
        parts = _single_arrows(plane, arrows, shading, comparison)
        title = "Errors where it ends"
    return plane.framed(title, *parts), shading.legend(f"error [{comparison['error_unit']}]")


def _arrows(comparison: Mapping[str, Any], when: When) -> _Arrows:
    near = _RESTING * comparison["scale"]
    trial, start, end, percent = [], [], [], []
    for row, some in enumerate(comparison["trials"]):
        if some["diverged"]:
            continue
        measured = np.array(some["measured"])
        if when == "moving":
            away = np.linalg.norm(measured - measured[-1], axis=1) > near
            chosen = np.arange(len(measured)) < np.flatnonzero(away).max(initial=-1) + 1
        else:
            chosen = np.arange(len(measured)) == len(measured) - 1
        trial.append(np.full(int(chosen.sum()), row))
        start.append(measured[chosen])
        end.append(np.array(some["predicted"])[chosen])
        percent.append(np.array(some["errors_percent"])[chosen])
    if not trial:
        return _Arrows(np.empty(0, int), np.empty((0, 2)), np.empty((0, 2)), np.empty(0))
    return _Arrows(*(np.concatenate(part) for part in (trial, start, end, percent)))


def _lines(plane: Plane, arrows: _Arrows, shading: Shading) -> list[Markup]:
    """Draw every error as a thin line, one element a colour."""
    begins, ends = _placed(plane, arrows.start), _placed(plane, arrows.end)
    shade = np.array([shading.index(p) for p in arrows.percent.tolist()], dtype=int)
    drawn = []
    for index, colour in enumerate(SHADES):
        chosen = np.flatnonzero(shade == index)
        way = "".join(_segment(begins[i], ends[i]) for i in chosen)
        if way:
            drawn.append(
                tag(
                    "path", d=way, stroke=colour, stroke_width=1.1, stroke_opacity=0.75, fill="none"
                )
            )
    return drawn


def _mean_arrows(plane: Plane, arrows: _Arrows) -> list[Markup]:
    """Draw the mean error of the trials in every cell of the board as a bold arrow."""
    if not len(arrows.start):
        return []
    span = float(np.ptp(arrows.start, axis=0).max()) or 1.0
    cell = ticks(0, span, _CELLS)[1]
    _, group = np.unique(np.floor(arrows.start / cell), axis=0, return_inverse=True)
    drawn = []
    for index in range(int(group.max()) + 1):
        inside = group.ravel() == index
        if len(np.unique(arrows.trial[inside])) >= _FEWEST:
            tail, head = (
                _placed(plane, points[inside].mean(axis=0, keepdims=True))[0]
                for points in (arrows.start, arrows.end)
            )
            drawn.append(
                tag("path", d=arrow_path(tail, head), stroke=INK, stroke_width=1.9, fill="none")
            )
            drawn.append(tag("circle", cx=float(tail[0]), cy=float(tail[1]), r=1.9, fill=INK))
    return drawn


def _single_arrows(
    plane: Plane, arrows: _Arrows, shading: Shading, comparison: Mapping[str, Any]
) -> list[Markup]:
    """Draw every trial's last error as an arrow that can be pointed at."""
    begins, ends = _placed(plane, arrows.start), _placed(plane, arrows.end)
    word = comparison["words"]["trial"]
    drawn = []
    for i in np.argsort(arrows.percent, kind="stable"):
        percent = float(arrows.percent[i])
        number = comparison["trials"][arrows.trial[i]]["trial"]
        colour = SHADES[shading.index(percent)]
        drawn.append(
            tag(
                "g",
                hint(f"{word} {number}: {error(percent)}"),
                tag("path", d=arrow_path(begins[i], ends[i]), stroke=colour, stroke_width=1.8),
                tag("circle", cx=float(begins[i][0]), cy=float(begins[i][1]), r=2.6, fill=colour),
                class_="pick",
                data_trial=number,
                fill="none",
            )
        )
    return drawn


def arrow_path(tail: np.ndarray, head: np.ndarray) -> str:
    """Return the path of an arrow from `tail` to `head`, both (2,) in the drawing."""
    way = head - tail
    length = float(np.hypot(*way))
    if length < 1:
        return _segment(tail, head)
    along = way / length
    across = np.array([-along[1], along[0]])
    size = min(6.0, 0.5 * length + 1)
    barbs = (head - size * (along + 0.55 * across), head - size * (along - 0.55 * across))
    return _segment(tail, head) + "".join(_segment(head, barb) for barb in barbs)


def _placed(plane: Plane, points: np.ndarray) -> np.ndarray:
    return plane.places(plane.lanes[0], np.empty(0), points)


def _segment(start: Sequence[float] | np.ndarray, end: Sequence[float] | np.ndarray) -> str:
    return f"M{start[0]:.1f} {start[1]:.1f}L{end[0]:.1f} {end[1]:.1f}"
