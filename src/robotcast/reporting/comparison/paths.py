"""Every cast's measured and predicted path: the worst as small pictures, all for the player."""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from markupsafe import Markup

from robotcast.reporting.comparison.plane import Plane, plane_of
from robotcast.reporting.inline_svg import INK, LINE, VERMILION, drawing, tag

_PLAYER, _SMALL = 560.0, 178.0
_WORST = 6


def player_frame(comparison: Mapping[str, Any]) -> Markup:
    """Draw the frame in which the script draws the chosen trial."""
    plane = plane_of(comparison, _PLAYER)
    return plane.framed("The chosen path", tag("g", " ", class_="stage", fill="none"))


def player_data(comparison: Mapping[str, Any]) -> Markup:
    """Return what the script needs, as JSON that is safe inside a script element.

    Paths are given in the drawing's own places: the script knows nothing of axes.
    """
    plane = plane_of(comparison, _PLAYER)
    data = {
        "unit": comparison["error_unit"],
        "word": comparison["words"]["trial"],
        "trials": [_trial(plane, some) for some in comparison["trials"]],
    }
    written = json.dumps(data, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return Markup(written.replace("<", "\\u003c"))


def _trial(plane: Plane, some: Mapping[str, Any]) -> dict[str, Any]:
    times = np.array(some["times_s"])
    return {
        "trial": some["trial"],
        "t": some["times_s"],
        "error": [round(e, 2) for e in some["errors_percent"]],
        "phases": [[start, name] for name, start in some["phases"].items()],
        "measured": _drawn(plane, times, np.array(some["measured"])),
        "predicted": []
        if some["diverged"]
        else _drawn(plane, times, np.array(some["predicted"], dtype=float)),
    }


def _drawn(plane: Plane, times_s: np.ndarray, path: np.ndarray) -> list[list[list[float]]]:
    """Return one list of places a lane."""
    return [np.round(plane.places(lane, times_s, path), 1).tolist() for lane in plane.lanes]


def worst_paths(comparison: Mapping[str, Any]) -> list[tuple[Mapping[str, Any], Markup]]:
    """Return the worst trial of the worst actions, each with a small picture of its paths."""
    worst: dict[int, Mapping[str, Any]] = {}
    for some in sorted(comparison["trials"], key=lambda t: -t["waypoint_percent"]):
        worst.setdefault(some["group"], some)
    plane = plane_of(comparison, _SMALL)
    return [(some, _small(plane, some)) for some in list(worst.values())[:_WORST]]


def _small(plane: Plane, some: Mapping[str, Any]) -> Markup:
    x0, x1 = sorted((plane.across.start, plane.across.end))
    y0, y1 = sorted((plane.up.start, plane.up.end))
    parts = [tag("rect", x=x0, y=y0, width=x1 - x0, height=y1 - y0, fill="#fff", stroke=LINE)]
    times = np.array(some["times_s"])
    for path, colour in ((some["measured"], INK), (some["predicted"], VERMILION)):
        if colour == VERMILION and some["diverged"]:
            continue
        for places in _drawn(plane, times, np.array(path, dtype=float)):
            way = "L".join(f"{x:.1f} {y:.1f}" for x, y in places)
            end = places[-1]
            parts += [
                tag(
                    "path",
                    d=f"M{way}",
                    stroke=colour,
                    stroke_width=1.5,
                    fill="none",
                    stroke_linejoin="round",
                ),
                tag("circle", cx=end[0], cy=end[1], r=2.8, fill=colour),
            ]
    inside = tag("g", *parts, transform=f"translate({1 - x0:.1f} {1 - y0:.1f})")
    return drawing(x1 - x0 + 2, y1 - y0 + 2, "Measured and predicted path", inside)
