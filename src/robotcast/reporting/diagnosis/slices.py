"""Which part of the error an effect explains: before and after, slice by slice."""

from collections.abc import Sequence

from markupsafe import Markup

from robotcast.reporting.diagnosis.reading import Slice
from robotcast.reporting.inline_svg import (
    BLUE,
    SOFT,
    Scale,
    drawing,
    hint,
    line,
    nice_top,
    tag,
    text,
)
from robotcast.reporting.numbers import error

_ROW, _BAR, _WIDTH, _LABELS, _VALUES = 34.0, 10.0, 520.0, 190.0, 56.0


def slices_figure(slices: Sequence[Slice], unit: str) -> Markup:
    """Draw one pair of bars a slice: grey without the effect, blue with it."""
    top = nice_top([v for s in slices for v in (s.before, s.after)])
    across = Scale(0.0, top, _LABELS, _WIDTH - _VALUES)
    rows = [_pair(s, across, 4 + _ROW * place, unit) for place, s in enumerate(slices)]
    height = 4 + _ROW * len(slices)
    foot = line(_LABELS, 0, _LABELS, height - 4)
    return drawing(_WIDTH, height, "Error before and after, by slice", foot, *rows)


def _pair(part: Slice, across: Scale, y: float, unit: str) -> Markup:
    bars = [
        hint(f"{part.name}: {error(part.before, unit)} without, {error(part.after, unit)} with it"),
        text(_LABELS - 10, y + 14, part.name, "end"),
    ]
    for offset, value, fill in ((0.0, part.before, "#b6bdc9"), (_BAR + 1, part.after, BLUE)):
        width = max(across(value) - across.start, 1.0)
        bars += [
            tag("rect", x=across.start, y=y + offset, width=width, height=_BAR, fill=fill),
            text(
                across(value) + 6,
                y + offset + 9,
                error(value, unit),
                font_size=11,
                fill=SOFT if offset == 0 else None,
            ),
        ]
    return tag("g", *bars)
