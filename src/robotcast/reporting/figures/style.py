"""How every figure looks, and how it is written so that the same results give the same bytes."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib
import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

# Okabe and Ito's palette, told apart by colour-blind readers
BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
YELLOW, BLUE, VERMILION, PURPLE = "#F0E442", "#0072B2", "#D55E00", "#CC79A7"
CYCLE = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, BLACK)
GREY = "#6b7280"

_SETTINGS: dict[Any, Any] = {
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


_MATH = {
    "π_R2S2R": r"$\pi_\mathrm{R2S2R}$",
    "π_RD": r"$\pi_\mathrm{RD}$",
    "π_SD": r"$\pi_\mathrm{SD}$",
    "D_real": r"$D_\mathrm{real}$",
    "D_sim": r"$D_\mathrm{sim}$",
}


@contextmanager
def style() -> Iterator[None]:
    """Draw with the report's settings and no others."""
    with rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_SETTINGS)
        yield


def svg(figure: Figure) -> bytes:
    """Return the figure as SVG without date, version or random ids."""
    with style(), io.BytesIO() as buffer:
        figure.draw_without_rendering()  # a first layout, which equal aspects then change
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
        return buffer.getvalue()


def board_axes(axes: Axes) -> None:
    """Label axes as the camera sees the board: x away from the robot upwards, y to the left."""
    axes.set_aspect("equal")
    if not axes.xaxis_inverted():
        axes.invert_xaxis()
    axes.set_xlabel("y [m], left of the robot")
    axes.set_ylabel("x [m], away from the robot")


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
