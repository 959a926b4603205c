"""The missing force: drawn, said where it points, and drafted as an effect of one's own."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure
from scipy.spatial import KDTree

from robotcast.reporting.names import number, quantity
from robotcast.reporting.page import block
from robotcast.reporting.style import (
    BLUE,
    CYCLE,
    GREY,
    INK,
    VERMILION,
    board_arrows,
    board_canvas,
    canvas,
    hint,
    inline,
    style,
)

Field = Mapping[str, Any]  # `field` of `unexplained` in diagnosis.json

_ARROWS = 400  # more of them hide each other
_AIMED = 0.9  # mean cosine from which arrows are said to point at one place


@style(on_page=True)
def field_figure(field: Field) -> Figure:
    """Draw the field: over two coordinates as arrows or discs on the board, over one as curves."""
    return _curves(field) if len(field["axes"]) == 1 else _board(field)


def strongest(field: Field) -> str:
    """Return where the field is strongest, in words."""
    points, values = _arrays(field)
    sizes = np.linalg.norm(values, axis=1)
    at = int(sizes.argmax())
    axes = (axis.partition("[") for axis in field["axes"])  # "x [m]"
    place = ", ".join(
        f"{name.strip()} = {quantity(value, unit.rstrip('] '))}"
        for (name, _, unit), value in zip(axes, points[at], strict=False)
    )
    return f"strongest, {quantity(sizes[at], field['unit'], 2)}, at {place}"


def focus(field: Field) -> tuple[np.ndarray, bool] | None:
    """Return the place (2,) that the arrows point at, and whether towards it or away from it.

    The place is the one nearest to all the lines that the arrows lie on, strong arrows counting
    most. None when the arrows do not point at one place.
    """
    points, values = _arrays(field)
    if points.shape[1] != 2 or values.shape != points.shape or len(points) < 4:
        return None
    sizes = np.linalg.norm(values, axis=1)
    along = values / np.where(sizes > 0, sizes, 1)[:, None]
    across = np.eye(2) - along[:, :, None] * along[:, None, :]
    weighed = sizes[:, None, None] * across
    matrix, vector = weighed.sum(axis=0), (weighed @ points[:, :, None]).sum(axis=0)[:, 0]
    if np.linalg.cond(matrix) > 1e4:  # parallel arrows meet nowhere
        return None
    place = np.linalg.solve(matrix, vector)
    away = points - place
    distance = np.linalg.norm(away, axis=1)
    cosine = -(along * away).sum(axis=1) / np.where(distance > 0, distance, 1)
    aim = float((sizes * cosine).sum() / sizes.sum())
    near = distance.min() < np.ptp(points, axis=0).max()
    return (place, aim > 0) if abs(aim) > _AIMED and near else None


def _arrays(field: Field) -> tuple[np.ndarray, np.ndarray]:
    """Return the points (n, d) at which the field is known, and its components there, (n, k)."""
    return np.array(field["points"], float), np.array(field["values"], float)


def _board(field: Field) -> Figure:
    points, values = _arrays(field)
    chosen = np.linspace(0, len(points) - 1, min(len(points), _ARROWS)).astype(int)
    points, values = points[chosen], values[chosen]
    margin = 0.06 * np.ptp(points, axis=0).max() or 0.1
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    figure, axes = board_canvas(low, high, 640, field["axes"], above=26)
    wide, tall = axes.bbox.size
    per_unit = tall / (high - low)[0]
    sizes = np.linalg.norm(values, axis=1)
    most, spacing = float(sizes.max()) or 1.0, _spacing(points)
    scalar, (x, y) = values.shape[1] == 1, points.T
    links = [hint(f"{number(v, 2)} {field['unit']}") for v in (values[:, 0] if scalar else sizes)]
    if scalar:  # the area tells the size, the colour the sign
        areas = (per_unit * spacing) ** 2 * np.abs(values[:, 0]) / most
        colors = np.where(values[:, 0] > 0, VERMILION, BLUE)
        axes.scatter(y, x, areas, colors, alpha=0.6, lw=0, urls=links)
        return figure
    drawn = board_arrows(axes, points, values, VERMILION, scale=most / (1.15 * spacing))
    drawn.set(alpha=0.35 + 0.65 * sizes / most, urls=links)
    axes.plot(y, x, ".", color=VERMILION, ms=4)
    # a positive y points to the left: the key's arrow ends at its place
    place = (1.15 * spacing * per_unit / wide, 1 + 14 / tall)
    label = f"{number(most, 2)} {field['unit']}"
    axes.quiverkey(drawn, *place, most, label, labelpos="E", labelcolor=GREY)
    if aimed := focus(field):
        words = f"the arrows point {'at this place' if aimed[1] else 'away from it'}"
        for marker, size in (("o", 18), ("+", 26)):
            looks = {"color": BLUE, "ms": size, "mfc": "none", "mew": 1.8, "url": hint(words)}
            axes.plot(*aimed[0][::-1], marker, **looks)
    return figure


def _spacing(points: np.ndarray) -> float:
    """Return the typical distance from a point to its nearest neighbour."""
    nearest = KDTree(points).query(points, k=2)[0][:, 1]
    return float(np.median(nearest)) if np.isfinite(nearest).all() else 0.1


def _curves(field: Field) -> Figure:
    points, values = _arrays(field)
    order = np.argsort(points[:, 0], kind="stable")
    at, values = points[order, 0], values[order]
    figure, axes = canvas(640, 296, 64, 12, 12, 46)
    axes.axhline(0, color=GREY, lw=1)
    for curve, color, name in zip(values.T, CYCLE, "xyz", strict=False):
        axes.plot(at, curve, color=color, lw=2, label=name)
        links = [
            hint(f"{field['axes'][0]}: {number(a)}; {quantity(v, field['unit'])}")
            for a, v in zip(at, curve, strict=True)
        ]
        axes.scatter(at, curve, 36, color, lw=0, urls=links, zorder=3)
    if values.shape[1] > 1:
        axes.legend()
    unit = field["unit"]  # a gain has none: it is a share of what drives
    force = "missing share of the drive" if unit == "1" else f"missing force [{unit}]"
    axes.set(xlabel=field["axes"][0], ylabel=force)
    return figure


def drafts(unexplained: Mapping[str, Any]) -> dict[str, str]:
    """Return file → text of an effect to start from, with a law that fits what the force is like.

    Numbers over the board are a resistance, arrows a force.
    """
    field, law = unexplained["field"], unexplained["depends_on"] or "place"
    if field and len(field["axes"]) == 2 and _arrays(field)[1].shape[1] == 1:
        law = "resistance of place"
    at_end = law == "endpoint" or bool(field and field.get("endpoint"))
    settings = block("drafts.txt", "settings", law, *_place(field))
    return {
        "src/robotcast/effects/my_effect.py": block("drafts.txt", "code", law, at_end).strip(),
        "conf/effects.yaml": settings.strip(),
    }


def _place(field: Field | None) -> tuple[float, float]:
    """Return the place that arrows point at, or where numbers are largest."""
    if field:
        points, values = _arrays(field)
        if points.shape[1] == 2 and values.shape[1] == 1:
            return tuple(points[values[:, 0].argmax()].tolist())
        if aimed := focus(field):
            return tuple(aimed[0].tolist())
    return 0.9, 0.0


Robot = Mapping[str, Any]  # `robot` of diagnosis.json
BINS = 15
MORE = 0.1  # of the scatter, that position and direction must explain beyond what speed does


def robot_block(robot: Robot, model: str | None) -> Markup:
    """Return the section; `model` is the file of the patched model, None before it is written."""
    windows = [
        (w, inline(traces_figure(robot["signals"], w), f"Window {w['window']} of {w['log']}"))
        for w in robot["windows"]
    ]
    torques, loops = robot["torques"], [j for j in robot["torques"] if _loops(j)]
    figures = [inline(torque_figure(torques, "speed"), "Missing torque against speed")]
    if loops:
        figures += [inline(torque_figure(loops, "position"), "Missing torque against position")]
    return block("robot.html", "section", robot, windows, figures, model)


@style(on_page=True)
def traces_figure(signals: list[Mapping[str, str]], window: Mapping[str, Any]) -> Figure:
    """Draw every signal, measured and predicted, and below it what the predictions miss."""
    n = len(signals)
    columns = 2 if n in (2, 4) else min(n, 3)
    rows = -(-n // columns)
    figure = Figure(figsize=(4.2 * columns, 3.4 * rows), layout="constrained")
    shown = (np.array(window[name]) for name in ("times_s", "measured", "base", "model"))
    times_s, measured, base, model = shown
    parts = figure.subfigures(rows, columns, squeeze=False).flat
    for k, (signal, part) in enumerate(zip(signals, parts, strict=False)):
        above, below = part.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        above.plot(times_s, measured[:, k], color=INK, lw=2.2)
        below.axhline(0, color=INK, lw=0.8)
        for path, color in ((base, VERMILION), (model, BLUE)):
            above.plot(times_s, path[:, k], color=color, lw=1.4)
            below.plot(times_s, path[:, k] - measured[:, k], color=color, lw=1.4)
        name, unit = signal["name"], signal["unit"]
        above.set_title(f"{name} [{unit}]" if unit else name, fontsize=11, color=INK)
        below.set(xlabel="time [s]", ylabel="off by")
    return figure


@style(on_page=True)
def torque_figure(joints: list[Mapping[str, Any]], of: str) -> Figure:
    """Draw what joints were driven by less what they needed, with medians.

    Over the speed, or over the position, one curve for each direction.
    """
    columns = min(len(joints), 3)
    rows = -(-len(joints) // columns)
    figure = Figure(figsize=(4.2 * columns, 2.8 * rows), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).flat
    for joint, axes in zip(joints, panels, strict=False):
        x, speed, torque = (np.array(joint[name], float) for name in (of, "speed", "torque"))
        axes.plot(x, torque, ".", color=GREY, ms=3, alpha=0.5)
        ways = [(BLUE, speed > 0), (VERMILION, speed < 0)]
        for color, some in ways if of == "position" else [(BLUE, np.ones(len(x), bool))]:
            axes.plot(*_medians(x[some], torque[some]), color=color, lw=2)
        low, high = np.quantile(torque, (0.02, 0.98))
        axes.set_ylim(low - 0.2 * (high - low), high + 0.2 * (high - low) + 1e-12)
        units, per = joint["units"], "/s" if of == "speed" else ""
        what = "force" if units["torque"] == "N" else "torque"
        axes.set(xlabel=f"{of} [{units['length']}{per}]", ylabel=f"{what} [{units['torque']}]")
        axes.set_title(joint["joint"], fontsize=11, color=INK)
    for empty in figure.axes[len(joints) :]:
        empty.set_axis_off()
    return figure


def _parts(x: np.ndarray) -> np.ndarray:
    """Return the part of every value, of as many that hold as many values each."""
    edges = np.quantile(x, np.linspace(0, 1, BINS + 1))
    return np.clip(np.searchsorted(edges, x, "right") - 1, 0, BINS - 1)


def _medians(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    if not len(x):
        return np.empty((2, 0))
    part = _parts(x)
    return np.array([[np.median(some[part == b]) for b in np.unique(part)] for some in (x, y)])


def _loops(joint: Mapping[str, Any]) -> bool:
    """Tell whether position and direction explain more of the missing torque than speed does."""
    position, speed, torque = (np.array(joint[n], float) for n in ("position", "speed", "torque"))

    def left(part: np.ndarray) -> float:
        return float(sum(len(t) * t.var() for t in (torque[part == b] for b in np.unique(part))))

    whole = len(torque) * float(torque.var())
    return left(_parts(position) + BINS * (speed > 0)) < left(_parts(speed)) - MORE * whole
