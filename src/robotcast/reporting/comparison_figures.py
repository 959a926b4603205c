"""A comparison drawn: how large the error is, when, where and for which actions.

Each figure is made from the dict of `comparison.json` alone.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from robotcast.reporting.names import factor_label
from robotcast.reporting.numbers import error
from robotcast.reporting.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    LINE,
    VERMILION,
    beside,
    board_arrows,
    canvas,
    hint,
    style,
)

Comparison = Mapping[str, Any]
When = Literal["moving", "rest"]

_SHADES = ("#c3c9d3", "#e8b96a", "#e8833a", "#cf4522", "#8c1218")
_RESTING = 0.01  # of scale: closer than this to where it ends, the signal rests
_CELLS = 14  # across the wider side of the board
_FEWEST = 3  # trials in a cell before their mean is drawn
_STRAY = 0.01  # of the predicted samples that may fall outside the frame on each side
_TALLEST = 0.86  # height of the frame over its width, at most
_TALL = 2.0  # times the error that nine trials in ten stay below: higher points are cut off


@style(on_page=True)
def error_bars(comparison: Comparison) -> Figure:
    """Draw the average and the final error as bars, each above its noise floor."""
    words, c = comparison["words"], comparison
    rows = (
        (f"average over {words['samples']}", f"mean over all {words['trials']}", "waypoint", ""),
        (f"last {words['sample']}", f"median over all {words['trials']}", "final", "_final"),
    )
    why = "how far repeats of one action lie from each other: no model can do better"
    figure, axes = canvas(600, 172, 192, 140, 4, 42)
    for row, (name, how, key, suffix) in enumerate(rows):
        model, noise = c[f"{key}_error_percent"], c[f"noise_floor{suffix}_percent"]
        beside(axes, name, 0, row, -192, 4, size=13.5, weight="bold")
        beside(axes, how, 0, row, -192, -13, size=11, color=GREY)
        bars = [(row - 0.16, model, BLUE, f"{error(model)} model", INK)]
        if noise is None:
            beside(axes, "noise floor unknown", 0, row + 0.16, 7, -4, color=GREY)
        else:
            bars.append((row + 0.16, noise, "#5bb899", f"{error(noise)} noise floor", "#00684b"))
        for y, value, fill, text, color in bars:
            (bar,) = axes.barh(y, value, 0.29, color=fill)
            if fill != BLUE:
                bar.set_url(hint(why))
            beside(axes, text, value, y, 7, -4, color=color)
    axes.set(ylim=(1.5, -0.5), yticks=[], xlabel=f"error [{c['error_unit']}]")
    axes.set_xlim(0, axes.get_xlim()[1] or 1)
    axes.spines["bottom"].set_visible(False)
    return figure


@style(on_page=True)
def course_figure(comparison: Comparison) -> Figure:
    """Draw the mean error and its quartiles over time, beside what repeats differ by."""
    course = {name: np.array(v, dtype=float) for name, v in comparison["over_time"].items()}
    times = course["times_s"]
    step = times[1] - times[0] if len(times) > 1 else 1.0
    figure, axes = canvas(760, 300, 52, 10, 40, 42)
    end = max(times[-1], times[0] + step)
    top = 1.08 * max(np.nanmax(course["mean"]), np.nanmax(course["upper"])) or 1.0
    axes.set(xlim=(times[0], end), ylim=(0, top), xlabel="time [s]")
    axes.set_ylabel(f"error [{comparison['error_unit']}]")
    axes.grid(axis="x", visible=False)
    axes.fill_between(times, course["lower"], course["upper"], color=BLUE, alpha=0.16, lw=0)
    axes.plot(times, course["noise"], color=GREEN, lw=1.6, ls=(0, (3, 2.5)))
    axes.plot(times, course["mean"], color=BLUE, lw=2.4, marker="o" if len(times) == 1 else "")
    _phases(axes, comparison["phases"])
    return figure


def _phases(axes: Axes, phases: Sequence[Mapping[str, Any]]) -> None:
    """Mark where phases start, in two rows of names where one would run into the next."""
    first, end = axes.get_xlim()
    shown = [p for p in phases if first <= p["start_s"] <= end]
    starts, taken = [*(p["start_s"] for p in shown), end], -math.inf
    for place, phase in enumerate(shown):
        start = starts[place]
        if place % 2 == 0:
            axes.axvspan(start, starts[place + 1], color=INK, alpha=0.035, lw=0)
        axes.axvline(start, color=LINE, lw=1)
        x, _ = axes.transData.transform((start, 0))
        up, taken = (8, x + 6.4 * len(phase["name"]) + 8) if x >= taken else (24, taken)
        edge = axes.get_ylim()[1]
        beside(axes, phase["name"], start, edge, 4, up, size=11.5, color="#374151")


@style(on_page=True)
def factor_figure(comparison: Comparison, name: str) -> Figure:
    """Draw every trial's error against one number of its action; all panels share their axis."""
    trend = comparison["factors"][name]
    all_errors = [t["waypoint_percent"] for t in comparison["trials"]]
    top = 1.05 * min(max(all_errors), _TALL * float(np.quantile(all_errors, 0.9))) or 1.0
    figure, axes = canvas(232, 186, 34, 10, 12, 38)
    values, errors = np.array(trend["values"]), np.array(trend["errors"])
    word = comparison["words"]["trial"]
    trials = [t["trial"] for t in comparison["trials"]]
    links = np.array(
        [hint(f"{word} {n}: {error(e)}", n) for n, e in zip(trials, errors, strict=True)]
    )
    beyond = errors > top
    dots = {"clip_on": False, "lw": 0, "zorder": 3}
    axes.scatter(values[~beyond], errors[~beyond], 41, GREY, alpha=0.6, urls=links[~beyond], **dots)
    tops = np.full(beyond.sum(), top)
    axes.scatter(values[beyond], tops, 60, VERMILION, marker="^", urls=links[beyond], **dots)
    running = np.minimum(trend["running_median"], top)
    axes.plot(trend["running_values"], running, color=BLUE, lw=2.4, zorder=4)
    axes.set(
        ylim=(0, top), xlabel=factor_label(name, comparison["words"]["factor_units"].get(name, ""))
    )
    axes.tick_params(labelsize=10.5)
    axes.grid(axis="x", visible=False)
    axes.xaxis.set_major_locator(MaxNLocator(4))
    axes.yaxis.set_major_locator(MaxNLocator(4))
    return figure


@style(on_page=True)
def residual_map(comparison: Comparison, when: When) -> Figure:
    """Draw all trials' errors as arrows, while the signal moves or where it ends, with a key."""
    figure, axes = _frame(comparison, 540, key=44)
    usual = [e for t in comparison["trials"] if not t["diverged"] for e in t["errors_percent"]]
    most = float(np.quantile(usual, 0.9)) if usual else 1.0
    steps = MaxNLocator(5, steps=[1, 2, 2.5, 5, 10]).tick_values(0, most or 1.0)
    bounds = steps[1] * np.arange(len(_SHADES) + 1)
    norm, shades = BoundaryNorm(bounds, len(_SHADES), clip=True), ListedColormap(_SHADES)
    width, height = 72 * figure.get_size_inches()
    key = figure.add_axes((52 / width, 1 - 12 / height, 230 / width, 9 / height))
    figure.colorbar(ScalarMappable(norm, shades), key, orientation="horizontal", ticks=bounds)
    key.set_xticks(bounds, [*(f"{b:g}" for b in bounds[:-1]), f"{bounds[-1]:g}+"])
    key.tick_params(length=0)
    key.grid(visible=False)
    label = f"error [{comparison['error_unit']}]"
    beside(key, label, bounds[-1], 0.5, 16, -4, size=11, color=GREY)
    trial, start, end, percent = _errors(comparison, when)
    shade = norm(percent)
    if when == "rest":
        _single_arrows(axes, comparison, trial, start, end, percent, np.array(_SHADES)[shade])
        return figure
    for index, color in enumerate(_SHADES):
        chosen = shade == index
        gaps = np.full_like(start[chosen], np.nan)
        lines = np.stack([start[chosen], end[chosen], gaps], axis=1).reshape(-1, 2)
        axes.plot(lines[:, 1], lines[:, 0], color=color, lw=1.1, alpha=0.75)
    _mean_arrows(axes, trial, start, end)
    return figure


def _errors(comparison: Comparison, when: When) -> tuple[np.ndarray, ...]:
    """Return the row of the trial (n,), measured and predicted place (n, 2), error in % (n,)."""
    near = _RESTING * comparison["scale"]
    found = [(np.empty(0, int), np.empty((0, 2)), np.empty((0, 2)), np.empty(0))]
    for row, some in enumerate(comparison["trials"]):
        if some["diverged"]:
            continue
        measured = np.array(some["measured"])
        chosen = slice(len(measured) - 1, None)
        if when == "moving":
            away = np.linalg.norm(measured - measured[-1], axis=1) > near
            chosen = slice(np.flatnonzero(away).max(initial=-1) + 1)
        start, end = measured[chosen], np.array(some["predicted"])[chosen]
        percent = np.array(some["errors_percent"])[chosen]
        found.append((np.full(len(start), row), start, end, percent))
    return tuple(np.concatenate(part) for part in zip(*found, strict=True))


def _mean_arrows(axes: Axes, trial: np.ndarray, start: np.ndarray, end: np.ndarray) -> None:
    """Draw the mean error of the trials in every cell of the board as a bold arrow."""
    if not len(start):
        return
    span = float(np.ptp(start, axis=0).max()) or 1.0
    cell = MaxNLocator(_CELLS, steps=[1, 2, 2.5, 5, 10]).tick_values(0, span)[1]
    _, group = np.unique(np.floor(start / cell), axis=0, return_inverse=True)
    inside = [group.ravel() == index for index in range(int(group.max()) + 1)]
    inside = [cell for cell in inside if len(np.unique(trial[cell])) >= _FEWEST]
    if inside:
        tails, heads = (np.array([p[cell].mean(axis=0) for cell in inside]) for p in (start, end))
        board_arrows(axes, tails, heads - tails, INK)
        axes.plot(tails[:, 1], tails[:, 0], "o", color=INK, ms=3.8, mew=0)


def _single_arrows(
    axes: Axes,
    comparison: Comparison,
    trial: np.ndarray,
    start: np.ndarray,
    end: np.ndarray,
    percent: np.ndarray,
    colors: np.ndarray,
) -> None:
    """Draw every trial's last error as an arrow that can be pointed at, the largest on top."""
    order = np.argsort(percent, kind="stable")
    word, trials = comparison["words"]["trial"], comparison["trials"]
    numbers = [trials[trial[i]]["trial"] for i in order]
    errors = [error(e) for e in percent[order].tolist()]
    links = [hint(f"{word} {n}: {e}", n) for n, e in zip(numbers, errors, strict=True)]
    if len(order):
        start, end, colors = start[order], end[order], colors[order]
        board_arrows(axes, start, end - start, colors).set_urls(links)
        axes.scatter(start[:, 1], start[:, 0], 27, colors, lw=0, urls=links, zorder=3)


def in_plane(comparison: Comparison) -> bool:
    """Tell whether the signal is a place in a plane."""
    axes = comparison["words"]["axes"]
    return len(axes) == 2 and all(axis["unit"] != "1" for axis in axes)


@style(on_page=True)
def player(comparison: Comparison, width: float = 560) -> tuple[Figure, list[dict[str, Any]]]:
    """Return the frame of all paths, and every trial's paths in pixels of it, lane by lane."""
    figure, axes = _frame(comparison, width)
    height = 72 * figure.get_figheight()

    def lanes(some: Mapping[str, Any], of: str) -> list[list[list[float]]]:
        path = np.array(some[of], dtype=float)
        pairs = [path[:, ::-1]]
        if not in_plane(comparison):
            pairs = [np.stack([some["times_s"], signal], axis=1) for signal in path.T]
        places = [axes.transData.transform(pair) for pair in pairs]
        return [np.round(np.stack([p[:, 0], height - p[:, 1]], axis=1), 1).tolist() for p in places]

    trials = [
        {
            "trial": some["trial"],
            "t": some["times_s"],
            "error": [round(e, 2) for e in some["errors_percent"]],
            "phases": [[start, name] for name, start in some["phases"].items()],
            "measured": lanes(some, "measured"),
            "predicted": [] if some["diverged"] else lanes(some, "predicted"),
        }
        for some in comparison["trials"]
    ]
    return figure, trials


def _frame(comparison: Comparison, width: float, key: float = 0) -> tuple[Figure, Axes]:
    """Return axes that hold every measured path and nearly all of the predicted ones.

    A board is seen by its robot, the first axis away from it and the second to its left; signals
    of another kind run over time. `key` pixels are left free above.
    """
    trials, named = comparison["trials"], comparison["words"]["axes"]
    low, high = _bounds(trials, len(named)).T.copy()
    inside = width - 58
    labels = [
        axis["name"]
        + (f" [{axis['unit']}]" if axis["unit"] else "")
        + (f", larger {axis['above']}" if axis["above"] else "")
        for axis in named
    ]
    if in_plane(comparison):
        away, left = high - low
        tall = min(away / left, _TALLEST) * inside
        spare = (away * inside / tall - left) / 2
        low[1], high[1] = low[1] - spare, high[1] + spare
        figure, axes = canvas(width, tall + 50 + key, 50, 8, 8 + key, 42)
        axes.set(xlim=(high[1], low[1]), ylim=(low[0], high[0]), xlabel=labels[1], ylabel=labels[0])
    else:
        figure, axes = canvas(width, 0.62 * width + key, 50, 8, 8 + key, 42)
        first, last = min(t["times_s"][0] for t in trials), max(t["times_s"][-1] for t in trials)
        axes.set(xlim=(first, max(last, first + 1e-9)), ylim=(low.min(), high.max()))
        axes.set(xlabel="time [s]", ylabel=", ".join(labels))
    axes.spines[["top", "right"]].set_visible(True)
    return figure, axes


def _bounds(trials: Sequence[Mapping[str, Any]], d: int) -> np.ndarray:
    """Return the range of every component with a margin, (d, 2)."""
    measured = np.concatenate([np.array(t["measured"]) for t in trials])
    low, high = measured.min(axis=0), measured.max(axis=0)
    kept = [np.array(t["predicted"]) for t in trials if not t["diverged"]]
    if kept:
        inner = np.quantile(np.concatenate(kept), (_STRAY, 1 - _STRAY), axis=0)
        low, high = np.minimum(low, inner[0]), np.maximum(high, inner[1])
    span = np.maximum(high - low, 1e-6)
    # a motion along a line still gets a frame with some width
    span = np.maximum(span, 0.2 * span.max()) if d == 2 else span
    return (low + high)[:, None] / 2 + 0.55 * span[:, None] * np.array([-1, 1])
