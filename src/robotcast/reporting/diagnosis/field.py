"""The missing force drawn: arrows over the board, or curves over one coordinate."""

import numpy as np
from markupsafe import Markup

from robotcast.reporting.diagnosis.reading import Field
from robotcast.reporting.inline_svg import (
    BLUE,
    FAINT,
    LINE,
    ORANGE,
    SOFT,
    VERMILION,
    Scale,
    drawing,
    hint,
    line,
    tag,
    text,
)
from robotcast.reporting.numbers import number, quantity

_WIDTH, _LEFT, _BOTTOM = 640.0, 64.0, 46.0
_ARROWS = 400  # more of them hide each other
_COLOURS = (BLUE, VERMILION, "#009e73", ORANGE)
_AIMED = 0.9  # mean cosine from which arrows are said to point at one place


def field_figure(field: Field) -> Markup:
    """Draw the field; two coordinates as arrows on the board, one as curves."""
    points, values = np.array(field.points), np.array(field.values)
    if points.shape[1] == 1:
        return _curves(field, points[:, 0], values)
    return _arrows(field, points[:, :2], values)


def strongest(field: Field) -> str:
    """Return where the field is strongest, in words."""
    sizes = np.linalg.norm(np.array(field.values), axis=1)
    at = int(sizes.argmax())
    place = ", ".join(
        f"{name} = {quantity(value, unit)}"
        for (name, unit), value in zip(map(_split, field.axes), field.points[at], strict=False)
    )
    return f"strongest, {quantity(sizes[at], field.unit, 2)}, at {place}"


def focus(field: Field) -> tuple[np.ndarray, bool] | None:
    """Return the place (2,) that the arrows point at, and whether towards it or away from it.

    The place is the one nearest to all the lines that the arrows lie on, strong arrows counting
    most. None when the arrows do not point at one place.
    """
    points, values = np.array(field.points), np.array(field.values)
    if points.ndim != 2 or points.shape[1] != 2 or values.shape != points.shape or len(points) < 4:
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


def _split(axis: str) -> tuple[str, str]:
    """Return name and unit of an axis written "x [m]"."""
    name, _, unit = axis.partition("[")
    return name.strip(), unit.rstrip("] ")


def _arrows(field: Field, points: np.ndarray, values: np.ndarray) -> Markup:
    """Draw arrows as the camera sees the board: x upwards, y to the left."""
    margin = 0.06 * np.ptp(points, axis=0).max() or 0.1
    (x_low, y_low), (x_high, y_high) = points.min(axis=0) - margin, points.max(axis=0) + margin
    per_unit = min((_WIDTH - _LEFT - 12) / (y_high - y_low), 420 / (x_high - x_low))
    width, height = per_unit * (y_high - y_low), per_unit * (x_high - x_low)
    across = Scale(y_low, y_high, _LEFT + width, _LEFT)
    up = Scale(x_low, x_high, 26 + height, 26)
    sizes = np.linalg.norm(values, axis=1)
    most = float(sizes.max()) or 1.0
    spacing = per_unit * _spacing(points)
    parts = [_frame(across, up, _axis(field.axes, 1), _axis(field.axes, 0))]
    chosen = np.linspace(0, len(points) - 1, min(len(points), _ARROWS)).astype(int)
    for row in chosen:
        at = (across(points[row, 1]), up(points[row, 0]))
        if values.shape[1] == 1:
            parts.append(_blob(at, values[row, 0], most, spacing, field.unit))
            continue
        length = 1.15 * spacing / most
        step = (-values[row, 1] * length, -values[row, 0] * length)
        parts.append(_arrow(at, step, f"{number(sizes[row], 2)} {field.unit}", sizes[row] / most))
    aimed = focus(field)
    if aimed is not None:
        parts.append(_cross(across(aimed[0][1]), up(aimed[0][0]), aimed[1]))
    if values.shape[1] > 1:
        parts.append(_key(_LEFT, 12, 1.15 * spacing, f"{number(most, 2)} {field.unit}"))
    return drawing(_LEFT + width + 12, 26 + height + _BOTTOM, "The missing force", *parts)


def _axis(axes: tuple[str, ...], index: int) -> str:
    return axes[index] if index < len(axes) else ""


def _spacing(points: np.ndarray) -> float:
    """Return the typical distance from a point to its nearest neighbour."""
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    np.fill_diagonal(apart, np.inf)
    nearest = apart.min(axis=1)
    return float(np.median(nearest)) if np.isfinite(nearest).all() else 0.1


def _frame(across: Scale, up: Scale, below: str, beside: str) -> Markup:
    left, right = sorted((across.start, across.end))
    low, high = up.start, up.end
    parts = [
        tag("rect", x=left, y=high, width=right - left, height=low - high, fill="none", stroke=LINE)
    ]
    for tick in across.ticks():
        at = across(tick)
        parts += [
            line(at, low, at, high, stroke=FAINT),
            text(at, low + 16, f"{tick:g}", "middle", font_size=11, fill=SOFT),
        ]
    for tick in up.ticks():
        at = up(tick)
        parts += [
            line(left, at, right, at, stroke=FAINT),
            text(left - 7, at + 4, f"{tick:g}", "end", font_size=11, fill=SOFT),
        ]
    middle, centre = (left + right) / 2, (low + high) / 2
    parts += [
        text(middle, low + 36, below, "middle", fill=SOFT),
        text(14, centre, beside, "middle", fill=SOFT, transform=f"rotate(-90 14 {centre:.1f})"),
    ]
    return tag("g", *parts)


def _arrow(at: tuple[float, float], step: tuple[float, float], words: str, share: float) -> Markup:
    (x, y), (dx, dy) = at, step
    length = float(np.hypot(dx, dy))
    tip = (x + dx, y + dy)
    parts = [
        hint(words),
        tag("circle", cx=x, cy=y, r=1.6),
        line(x, y, *tip, stroke=VERMILION, stroke_width=1.8),
    ]
    if length > 3:
        head = min(6.0, 0.45 * length)
        along = np.array([dx, dy]) / length
        side = np.array([-along[1], along[0]])
        back = np.array(tip) - head * along
        corners = [tip, tuple(back + 0.5 * head * side), tuple(back - 0.5 * head * side)]
        parts.append(tag("path", d="M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in corners) + "z"))
    return tag("g", *parts, fill=VERMILION, opacity=0.35 + 0.65 * float(share))


def _blob(at: tuple[float, float], value: float, most: float, spacing: float, unit: str) -> Markup:
    """Draw a number at a place: the area tells its size, the colour its sign."""
    radius = 0.5 * spacing * float(np.sqrt(abs(value) / most))
    fill = VERMILION if value > 0 else BLUE
    words = hint(f"{number(value, 2)} {unit}")
    return tag("circle", words, cx=at[0], cy=at[1], r=radius, fill=fill, fill_opacity=0.6)


def _cross(x: float, y: float, towards: bool) -> Markup:
    words = hint("the arrows point at this place" if towards else "the arrows point away from it")
    return tag(
        "g",
        words,
        tag("circle", cx=x, cy=y, r=9, fill="none", stroke=BLUE, stroke_width=2),
        line(x - 13, y, x + 13, y, stroke=BLUE, stroke_width=1.5),
        line(x, y - 13, x, y + 13, stroke=BLUE, stroke_width=1.5),
    )


def _key(x: float, y: float, length: float, words: str) -> Markup:
    arrow = _arrow((x, y), (length, 0.0), words, 1.0)
    return tag("g", arrow, text(x + length + 8, y + 4, words, fill=SOFT))


def _curves(field: Field, at: np.ndarray, values: np.ndarray) -> Markup:
    order = np.argsort(at, kind="stable")
    at, values = at[order], values[order]
    reach = max(float(np.abs(values).max()), 1e-300)
    low, high = min(values.min(), 0.0) - 0.08 * reach, max(values.max(), 0.0) + 0.08 * reach
    spread = float(np.ptp(at)) or 1.0
    across = Scale(at[0] - 0.02 * spread, at[-1] + 0.02 * spread, _LEFT, _WIDTH - 12)
    up = Scale(low, high, 250.0, 12.0)
    parts = [_frame(across, up, _axis(field.axes, 0), f"missing force [{field.unit}]")]
    parts.append(line(across.start, up(0.0), across.end, up(0.0), stroke=SOFT))
    for component in range(values.shape[1]):
        colour = _COLOURS[component % len(_COLOURS)]
        places = [(across(a), up(v)) for a, v in zip(at, values[:, component], strict=True)]
        path = "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in places)
        parts.append(tag("path", d=path, fill="none", stroke=colour, stroke_width=2))
        for (x, y), a, v in zip(places, at, values[:, component], strict=True):
            words = hint(f"{_axis(field.axes, 0)}: {number(a)}; {quantity(v, field.unit)}")
            parts.append(tag("circle", words, cx=x, cy=y, r=3, fill=colour))
    return drawing(_WIDTH, 250 + _BOTTOM, "The missing force", *parts)
