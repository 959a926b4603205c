"""Colours for the size of an error: grey where it is small, darker and redder as it grows."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from robotcast.reporting.inline_svg import SOFT, drawing, tag, text, ticks

SHADES = ("#c3c9d3", "#e8b96a", "#e8833a", "#cf4522", "#8c1218")


@dataclass(frozen=True)
class Shading:
    """Classes of equal width from 0 to `top` percent; what is larger has the last colour."""

    top: float

    @classmethod
    def of(cls, errors: Sequence[float] | np.ndarray) -> "Shading":
        """Reach as far as nine errors in ten."""
        most = float(np.quantile(errors, 0.9)) if len(errors) else 1.0
        step = ticks(0, most or 1.0, 5)[1] if most else 0.2
        return cls(step * len(SHADES))

    def index(self, error: float) -> int:
        """Return the class of an error."""
        return min(int(error / self.top * len(SHADES)), len(SHADES) - 1)

    def legend(self, label: str) -> Markup:
        """Draw the classes with their bounds."""
        width = 46.0
        parts: list[Markup] = []
        for index, shade in enumerate(SHADES):
            x = 2 + width * index
            parts.append(tag("rect", x=x, y=2.0, width=width, height=9.0, fill=shade))
            bound = f"{self.top * index / len(SHADES):g}"
            parts.append(text(x, 24, bound, "start" if index == 0 else "middle", font_size=11))
        end = 2 + width * len(SHADES)
        parts.append(text(end, 24, f"{self.top:g}+", "middle", font_size=11))
        parts.append(text(end + 22, 24, label, font_size=11, fill=SOFT))
        return drawing(end + 22 + 6.2 * len(label), 28.0, label, *parts)
