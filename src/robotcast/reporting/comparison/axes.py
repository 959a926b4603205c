"""The two axes that figures of errors share: errors upwards, another number to the right."""

from markupsafe import Markup

from robotcast.reporting.comparison.labels import tick_label
from robotcast.reporting.inline_svg import FAINT, SOFT, Scale, line, text


def axes(across: Scale, up: Scale, label: str, ticks: tuple[int, int], size: float) -> list[Markup]:
    """Draw grid lines, ticks and the label below.

    Parameters
    ----------
    ticks : about how many to the right and upwards.
    size : of the ticks' letters.
    """
    parts = []
    for value in up.ticks(ticks[1]):
        y = up(value)
        parts += [
            line(across.start, y, across.end, y, stroke=FAINT),
            text(across.start - 6, y + 4, tick_label(value), "end", font_size=size, fill=SOFT),
        ]
    for value in across.ticks(ticks[0]):
        x = across(value)
        parts += [
            line(x, up.start, x, up.start + 4),
            text(x, up.start + 16, tick_label(value), "middle", font_size=size, fill=SOFT),
        ]
    middle = (across.start + across.end) / 2
    return [
        *parts,
        line(across.start, up.start, across.end, up.start),
        text(middle, up.start + 32, label, "middle", font_size=size + 1, fill=SOFT),
    ]
