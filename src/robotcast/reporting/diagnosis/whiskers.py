"""How large an effect is: a dot with its interval, against the line where it does nothing."""

from markupsafe import Markup

from robotcast.reporting.diagnosis.reading import Size
from robotcast.reporting.inline_svg import BLUE, SOFT, Scale, drawing, hint, line, tag
from robotcast.reporting.numbers import number, with_interval, with_unit

_WIDTH, _HEIGHT = 120.0, 18.0


def whisker(size: Size) -> Markup:
    """Draw one parameter; its null is the grey upright line."""
    marks = [v for v in (size.value, size.low, size.high, size.null) if v is not None]
    spread = max(marks) - min(marks) or abs(size.value) or 1.0
    across = Scale(min(marks) - 0.08 * spread, max(marks) + 0.08 * spread, 4.0, _WIDTH - 4)
    middle = _HEIGHT / 2
    low = size.value if size.low is None else size.low
    high = size.value if size.high is None else size.high
    parts = [hint(in_words(size)), line(0, middle, _WIDTH, middle)]
    if size.null is not None:
        at = across(size.null)
        parts.append(line(at, 1, at, _HEIGHT - 1, stroke=SOFT, stroke_width=1.5))
    parts += [
        line(across(low), middle, across(high), middle, stroke=BLUE, stroke_width=2.5),
        tag("circle", cx=across(size.value), cy=middle, r=4, fill=BLUE),
    ]
    return drawing(_WIDTH, _HEIGHT, in_words(size), *parts)


def in_words(size: Size) -> str:
    """Return the parameter with its interval and its null in words."""
    value, low, high = with_interval(size.value, size.low, size.high)
    words = f"{size.name} = {with_unit(value, size.unit)}"
    if size.low is not None and size.high is not None:
        words += f", between {low} and {with_unit(high, size.unit)}"
    if size.null is not None:
        words += f"; at {with_unit(number(size.null), size.unit)} the effect does nothing"
    return words


def shortly(size: Size) -> tuple[str, str]:
    """Return the value with its unit, and the interval in brackets or nothing."""
    value, low, high = with_interval(size.value, size.low, size.high)
    known = size.low is not None and size.high is not None
    return with_unit(value, size.unit), f"[{low}, {high}]" if known else ""
