"""What a page shows of a robot: windows as measured and predicted, missing torque by speed."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure

from robotcast.reporting.page import block
from robotcast.reporting.style import BLUE, GREY, INK, VERMILION, inline, style

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
    times_s = np.array(window["times_s"], float)
    measured, base, model = (
        np.array(window[name], float) for name in ("measured", "base", "model")
    )
    for k, (signal, part) in enumerate(
        zip(signals, figure.subfigures(rows, columns, squeeze=False).flat, strict=False)
    ):
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
    """Draw for joints what each was driven by less what it needed, with medians.

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
