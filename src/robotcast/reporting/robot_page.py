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


def robot_block(robot: Robot, model: str | None) -> Markup:
    """Return the section; `model` is the file of the patched model, None before it is written."""
    windows = [
        (w, inline(traces_figure(robot["signals"], w), f"Window {w['window']} of {w['log']}"))
        for w in robot["windows"]
    ]
    torques = inline(torque_figure(robot["torques"]), "Missing torque against speed")
    return block("robot.html", "section", robot, windows, torques, model)


@style(on_page=True)
def traces_figure(signals: list[Mapping[str, str]], window: Mapping[str, Any]) -> Figure:
    """Draw every signal, measured and predicted, and below it what the predictions miss."""
    n = len(signals)
    figure = Figure(figsize=(4.2 * min(n, 3), 3.4 * -(-n // 3)), layout="constrained")
    times_s = np.array(window["times_s"], float)
    measured, base, model = (
        np.array(window[name], float) for name in ("measured", "base", "model")
    )
    for k, (signal, part) in enumerate(
        zip(signals, figure.subfigures(-(-n // 3), min(n, 3), squeeze=False).flat, strict=False)
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
def torque_figure(torques: list[Mapping[str, Any]]) -> Figure:
    """Draw for every joint what it was driven by less what it needed, and medians over speed."""
    columns = min(len(torques), 3)
    rows = -(-len(torques) // columns)
    figure = Figure(figsize=(4.2 * columns, 2.8 * rows), layout="constrained")
    for joint, axes in zip(
        torques, figure.subplots(rows, columns, squeeze=False).flat, strict=False
    ):
        speed, torque = np.array(joint["speed"], float), np.array(joint["torque"], float)
        axes.plot(speed, torque, ".", color=GREY, ms=3, alpha=0.5)
        edges = np.quantile(speed, np.linspace(0, 1, BINS + 1))
        part = np.clip(np.searchsorted(edges, speed, "right") - 1, 0, BINS - 1)
        kept = [b for b in range(BINS) if (part == b).any()]
        middle = [[np.median(some[part == b]) for b in kept] for some in (speed, torque)]
        axes.plot(*middle, color=BLUE, lw=2)
        low, high = np.quantile(torque, (0.02, 0.98))
        axes.set_ylim(low - 0.2 * (high - low), high + 0.2 * (high - low) + 1e-12)
        units = ("rad/s", "N m") if joint["hinge"] else ("m/s", "N")
        axes.set(xlabel=f"speed [{units[0]}]", ylabel=f"[{units[1]}]")
        axes.set_title(joint["joint"], fontsize=11, color=INK)
    return figure
