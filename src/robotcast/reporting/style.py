"""How every figure looks, and how it is written so that the same results give the same bytes."""

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib
import numpy as np
from markupsafe import Markup, escape
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.quiver import Quiver

# Okabe and Ito's palette, told apart by colour-blind readers
BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
YELLOW, BLUE, VERMILION, PURPLE = "#F0E442", "#0072B2", "#D55E00", "#CC79A7"
CYCLE = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, BLACK)
GREY, INK, LINE, FAINT = "#6b7280", "#1f2937", "#d1d5db", "#eef1f5"

_FIGURE: dict[Any, Any] = {
    "svg.hashsalt": "robotcast",
    "svg.fonttype": "path",
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.titlesize": 9.5,
    "axes.labelsize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": GREY,
    "axes.linewidth": 0.8,
    "xtick.color": "#374151",
    "ytick.color": "#374151",
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "figure.constrained_layout.use": True,
    "path.simplify": True,
}
_ON_PAGE: dict[Any, Any] = {
    **_FIGURE,
    "svg.fonttype": "none",
    "text.color": INK,
    "font.size": 12,
    "axes.labelsize": 11.5,
    "axes.labelcolor": GREY,
    "axes.edgecolor": LINE,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": FAINT,
    "xtick.color": LINE,
    "ytick.color": LINE,
    "xtick.labelcolor": GREY,
    "ytick.labelcolor": GREY,
    "xtick.labelsize": 11,
    "ytick.labelsize": 11,
    "figure.constrained_layout.use": False,
}
_MATH = {
    "π_R2S2R": r"$\pi_\mathrm{R2S2R}$",
    "π_RD": r"$\pi_\mathrm{RD}$",
    "π_SD": r"$\pi_\mathrm{SD}$",
    "D_real": r"$D_\mathrm{real}$",
    "D_sim": r"$D_\mathrm{sim}$",
}
_NEEDLESS = r'<(metadata|style).*?</\1>|<!--.*?-->| xmlns(:xlink)?="[^"]*"| id="[A-Za-z0-9.]+_\d+"'


@contextmanager
def style(*, on_page: bool = False) -> Iterator[None]:
    """Draw with these settings and no others: a figure of its own, or one that a page holds."""
    with rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_ON_PAGE if on_page else _FIGURE)
        yield


def canvas(
    width: float, height: float, left: float, right: float, top: float, bottom: float
) -> tuple[Figure, Axes]:
    """Return a figure for a page, and its axes within margins; all in pixels, like its letters."""
    figure = Figure(figsize=(width / 72, height / 72), dpi=72)
    inside = ((width - left - right) / width, (height - top - bottom) / height)
    return figure, figure.add_axes((left / width, bottom / height, *inside))


def beside(
    axes: Axes, text: str, x: float, y: float, right: float, up: float, **looks: Any
) -> None:
    """Write text so many pixels to the right of a place and above it, inside the axes or not."""
    axes.annotate(
        text, (x, y), (right, up), textcoords="offset points", annotation_clip=False, **looks
    )


def svg(figure: Figure) -> bytes:
    """Return the figure as SVG without date, version or random ids."""
    with style(), io.BytesIO() as buffer:
        figure.draw_without_rendering()  # a first layout, which equal aspects then change
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
        return buffer.getvalue()


def inline(figure: Figure, title: str) -> Markup:
    """Return the figure as an element of a page, its letters as text; `title` is read aloud.

    An artist whose URL is `hint(…)` shows it to a resting pointer.
    """
    with style(on_page=True), io.StringIO() as buffer:
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
        text = buffer.getvalue()
    text = re.sub(_NEEDLESS, "", text[text.index("<svg") :], flags=re.S)
    text = re.sub(r'(width|height)="([\d.]+)pt"', r'\1="\2"', text)
    text = re.sub(r'<a xlink:href="hint:(\d*)\|([^"]*)"[^>]*>', _hinted, text)
    text = text.replace("</a>", "</g>")
    looks = f'role="img" aria-label="{escape(title)}" stroke-linejoin="round"'
    return Markup(text.replace("<svg", f"<svg {looks}", 1))


def hint(text: str, trial: int | None = None) -> str:
    """Return the URL by which `inline` gives an artist a hint, and the trial that a click picks."""
    return f"hint:{'' if trial is None else trial}|{text}"


def _hinted(found: re.Match[str]) -> str:
    trial, words = found.groups()
    pick = f' class="pick" data-trial="{trial}"' if trial else ""
    return f"<g{pick}><title>{words}</title>"


def board_axes(axes: Axes) -> None:
    """Label axes as the camera sees the board: x away from the robot upwards, y to the left."""
    axes.set_aspect("equal")
    if not axes.xaxis_inverted():
        axes.invert_xaxis()
    axes.set_xlabel("y [m], left of the robot")
    axes.set_ylabel("x [m], away from the robot")


def board_arrows(
    axes: Axes, tails: np.ndarray, ways: np.ndarray, colors: Any, scale: float = 1.0
) -> Quiver:
    """Draw arrows on a board from `tails` (n, 2) by `ways` (n, 2), `scale` of them to a metre."""
    looks = {"angles": "xy", "scale_units": "xy", "scale": scale, "units": "dots", "width": 1.8}
    heads = {"headwidth": 5, "headlength": 5, "headaxislength": 4, "minlength": 0.6, "zorder": 3}
    sides = (tails[:, 1], tails[:, 0], ways[:, 1], ways[:, 0])
    return axes.quiver(*sides, color=colors, **looks, **heads)


def fit_height(figure: Figure, panel_in: float, around_in: float, rows: int = 1) -> None:
    """Make the figure as high as panels of equal aspect need, with no empty bands.

    Parameters
    ----------
    panel_in : width of a panel's axes [inch].
    around_in : height of titles, labels and legend [inch], of every row.
    """
    panel = figure.axes[0]
    (left, right), (low, high) = panel.get_xlim(), panel.get_ylim()
    height = panel_in * (high - low) / abs(right - left)
    figure.set_figheight(rows * (float(np.clip(height, 1.2, 6.0)) + around_in))


def math_text(text: str) -> str:
    """Return `text` with the paper's symbols as matplotlib writes them."""
    for symbol, written in _MATH.items():
        text = text.replace(symbol, written)
    return text
