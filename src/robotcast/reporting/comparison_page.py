"""The page that lays a model's predictions beside the measured casts, and its blocks.

All is made from the dict of `comparison.json` alone. A page that shows any block includes
blocks.css in its style, and casts.js at its end if it shows `casts_block`.
"""

import json
import math
import shlex
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from robotcast.diagnosis.rule import RULE
from robotcast.reporting.missing_force import robot_block
from robotcast.reporting.names import error, factor_label, rig_name
from robotcast.reporting.page import block, render
from robotcast.reporting.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    LINE,
    VERMILION,
    Bar,
    Row,
    bars,
    beside,
    board_arrows,
    board_canvas,
    canvas,
    hint,
    inline,
    style,
)

Comparison = Mapping[str, Any]

_BLOCKS = "blocks.html"
_WORST = 6
_SHADES = ("#c3c9d3", "#e8b96a", "#e8833a", "#cf4522", "#8c1218")
_RESTING = 0.01  # of scale: closer than this to where it ends, the signal rests
_CELLS = 14  # across the wider side of the board
_FEWEST = 3  # trials in a cell before their mean is drawn
_STRAY = 0.01  # of the predicted samples that may fall outside the frame on each side
_TALL = 2.0  # times the error that nine trials in ten stay below: higher points are cut off
_ROUND = [1, 2, 2.5, 5, 10]


def comparison_page(comparison: Comparison) -> str:
    """Return the page of `Comparison.as_dict()`.

    With `rig`, `measurements` (the folder of the set), `model` (what predicted, in a few words) and
    `notes` (sentences on limits of the data).
    """
    robot, source = comparison.get("robot"), comparison["measurements"]
    chosen = [*comparison.get("overrides", ()), f"{'robot' if robot else 'measurements'}={source}"]
    return render(
        "comparison.html",
        c=comparison,
        words=comparison["words"],
        state=_state(comparison),
        rig=rig_name(comparison["rig"]),
        command=shlex.join(["python", "stages/diagnose.py", *chosen, "output=OUT"]),
        bars=inline(_errors_figure(comparison), "Errors beside the noise floor"),
        where=where_blocks(comparison),
        robot=robot_block(robot, comparison.get("patched")) if robot else "",
        casts=None if robot else casts_block(comparison),
    )


def _state(comparison: Comparison) -> str:
    """Return "missing" when the model errs by more than noise, "within" when it does not.

    And "open" when nobody knows the noise.
    """
    floor = comparison["noise_floor_percent"]
    if floor is None:
        return "open"
    return "within" if comparison["waypoint_error_percent"] <= RULE.at_floor * floor else "missing"


def where_blocks(comparison: Comparison) -> dict[str, Markup]:
    """Return what shows where a model fails: by slices, over time, on a map, by factors.

    The map is empty for signals that are no place, the factors where none varies.
    """
    c = comparison
    blocks = {
        "slices": block(_BLOCKS, "slices", c),
        "time": block(_BLOCKS, "time", c, inline(_course_figure(c), "Error over time")),
        "map": Markup(""),
        "factors": Markup(""),
    }
    if c["words"]["plane"]:
        moving = inline(_residual_map(c, "moving"), "Errors while it moves")
        rest = inline(_residual_map(c, "rest"), "Errors where it ends")
        blocks["map"] = block(_BLOCKS, "map", c, moving, rest)
    if names := c["factors"]:
        figures = [inline(_factor_figure(c, name), f"Error against {name}") for name in names]
        blocks["factors"] = block(_BLOCKS, "factors", c, figures)
    return blocks


def casts_block(comparison: Comparison) -> Markup:
    """Every trial: the worst as pictures, a table to sort, and a player of the chosen one.

    The player's script knows nothing of axes: it gets paths in the drawing's own places.
    """
    figure, paths = _player(comparison)
    stage = Markup('<g class="stage" fill="none"></g></svg>')
    words = comparison["words"]
    data = {"unit": comparison["error_unit"], "word": words["trial"], "trials": paths}
    text = json.dumps(data, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    trials = sorted(comparison["trials"], key=lambda t: -t["waypoint_percent"])
    worst = {t["group"]: t for t in reversed(trials)}  # of every group
    worst = sorted(worst.values(), key=lambda t: -t["waypoint_percent"])[:_WORST]
    drawn = {path["trial"]: path for path in paths}
    return block(
        _BLOCKS,
        "casts",
        comparison,
        worst=[(t, drawn[t["trial"]]) for t in worst],
        frame=inline(figure, "The chosen path").replace("</svg>", stage),
        frame_height=72 * figure.get_figheight() - 50,
        data=Markup(text.replace("<", "\\u003c")),  # safe inside a script element
        factors=[(name, _factor_label(comparison, name)) for name in trials[0]["factors"]],
        trials=trials,
    )


def _factor_label(comparison: Comparison, name: str) -> str:
    return factor_label(name, comparison["words"]["factor_units"].get(name, ""))


def _errors_figure(comparison: Comparison) -> Figure:
    """Draw the average and the final error as bars, each above its noise floor."""
    words, rows = comparison["words"], []
    for name, how, key, suffix in (
        (f"average over {words['samples']}", "mean", "waypoint", ""),
        (f"last {words['sample']}", "median", "final", "_final"),
    ):
        noise = comparison[f"noise_floor{suffix}_percent"]
        floor = Bar(noise, "noise", "noise floor" if noise is not None else "noise unknown")
        model = Bar(comparison[f"{key}_error_percent"], note="model")
        seen = sum(trial[f"{key}_percent"] is not None for trial in comparison["trials"])
        rows.append(Row(name, (model, floor), f"{how} over {seen} {words['trials']}"))
    return bars(rows, f"error [{comparison['error_unit']}]", width=600, names=186)


@style(on_page=True)
def _course_figure(comparison: Comparison) -> Figure:
    """Draw the mean error and its quartiles over time, beside what repeats differ by."""
    course = {name: np.array(v, dtype=float) for name, v in comparison["over_time"].items()}
    times = course["times_s"]
    step = times[1] - times[0] if len(times) > 1 else 1.0
    figure, axes = canvas(760, 300, 52, 10, 40 if comparison["phases"] else 12, 42)
    end = max(times[-1], times[0] + step)
    top = 1.08 * max(np.nanmax(course["mean"]), np.nanmax(course["upper"])) or 1.0
    axes.set(xlim=(times[0], end), ylim=(0, top), xlabel="time [s]")
    axes.set_ylabel(f"error [{comparison['error_unit']}]")
    axes.grid(axis="x", visible=False)
    axes.fill_between(times, course["lower"], course["upper"], color=BLUE, alpha=0.16, lw=0)
    axes.plot(times, course["noise"], color=GREEN, lw=1.6, ls=(0, (3, 2.5)))
    axes.plot(times, course["mean"], color=BLUE, lw=2.4, marker="o" if len(times) == 1 else "")
    shown = [p for p in comparison["phases"] if times[0] <= p["start_s"] <= end]
    starts, taken = [*(p["start_s"] for p in shown), end], -math.inf
    for place, phase in enumerate(shown):  # two rows of names where one would run into the next
        start = starts[place]
        if place % 2 == 0:
            axes.axvspan(start, starts[place + 1], color=INK, alpha=0.035, lw=0)
        axes.axvline(start, color=LINE, lw=1)
        x, _ = axes.transData.transform((start, 0))
        up, taken = (8, x + 6.4 * len(phase["name"]) + 8) if x >= taken else (24, taken)
        beside(axes, phase["name"], start, top, 4, up, size=11.5, color="#374151")
    return figure


@style(on_page=True)
def _factor_figure(comparison: Comparison, name: str) -> Figure:
    """Draw every trial's error against one number of its action; all panels share their axis."""
    trend = comparison["factors"][name]
    all_errors = [t["waypoint_percent"] for t in comparison["trials"]]
    top = 1.05 * min(max(all_errors), _TALL * float(np.quantile(all_errors, 0.9))) or 1.0
    figure, axes = canvas(232, 186, 34, 10, 12, 38)
    values, errors = np.array(trend["values"]), np.array(trend["errors"])
    links = np.array(_links(comparison, range(len(errors)), trend["errors"]))
    beyond = errors > top
    dots = {"clip_on": False, "lw": 0, "zorder": 3}
    axes.scatter(
        values[~beyond], errors[~beyond], 41, GREY, alpha=0.6, urls=links[~beyond].tolist(), **dots
    )
    tops = np.full(beyond.sum(), top)
    axes.scatter(
        values[beyond], tops, 60, VERMILION, marker="^", urls=links[beyond].tolist(), **dots
    )
    running = np.minimum(trend["running_median"], top)
    marker = "o" if len(running) == 1 else ""
    axes.plot(trend["running_values"], running, color=BLUE, lw=2.4, zorder=4, marker=marker)
    axes.set(ylim=(0, top), xlabel=_factor_label(comparison, name))
    axes.tick_params(labelsize=10.5)
    axes.grid(axis="x", visible=False)
    axes.xaxis.set_major_locator(MaxNLocator(4, integer=bool((values % 1 == 0).all())))
    axes.yaxis.set_major_locator(MaxNLocator(4))
    return figure


def _links(comparison: Comparison, rows: Any, errors: Any) -> list[str]:
    """Return hints that name trials, given by their rows, and their errors, and pick them."""
    word, trials = comparison["words"]["trial"], comparison["trials"]
    pairs = [(trials[row]["trial"], error(e)) for row, e in zip(rows, errors, strict=True)]
    return [hint(f"{word} {number}: {text}", number) for number, text in pairs]


@style(on_page=True)
def _residual_map(comparison: Comparison, when: Literal["moving", "rest"]) -> Figure:
    """Draw all trials' errors as arrows, while the signal moves or where it ends, with a key."""
    figure, axes = _frame(comparison, 540, key=44)
    usual = [e for t in comparison["trials"] if not t["diverged"] for e in t["errors_percent"]]
    most = float(np.quantile(usual, 0.9)) if usual else 1.0
    bounds = MaxNLocator(5, steps=_ROUND).tick_values(0, most or 1.0)[1] * np.arange(6)
    norm, shades = BoundaryNorm(bounds, len(_SHADES), clip=True), ListedColormap(_SHADES)
    width, height = 72 * figure.get_size_inches()
    key = figure.add_axes((52 / width, 1 - 12 / height, 230 / width, 9 / height))
    figure.colorbar(ScalarMappable(norm, shades), key, orientation="horizontal", ticks=bounds)
    key.set_xticks(bounds, [*(f"{b:g}" for b in bounds[:-1]), f"{bounds[-1]:g}+"])
    key.tick_params(length=0)
    key.grid(visible=False)
    label = f"error [{comparison['error_unit']}]"
    beside(key, label, bounds[-1], 0.5, 16, -4, size=11, color=GREY)
    row, start, end, percent = _errors(comparison, when)
    shade = norm(percent)
    if when == "rest":  # arrows that can be pointed at, the largest on top
        order = np.argsort(percent, kind="stable")
        links = _links(comparison, row[order], percent[order].tolist())
        if len(order):
            start, end, colors = start[order], end[order], np.array(_SHADES)[shade[order]]
            board_arrows(axes, start, end - start, colors).set_urls(links)
            axes.scatter(start[:, 1], start[:, 0], 27, colors, lw=0, urls=links, zorder=3)
        return figure
    for index, color in enumerate(_SHADES):
        chosen = shade == index
        gaps = np.full_like(start[chosen], np.nan)
        lines = np.stack([start[chosen], end[chosen], gaps], axis=1).reshape(-1, 2)
        axes.plot(lines[:, 1], lines[:, 0], color=color, lw=1.1, alpha=0.75)
    _mean_arrows(axes, row, start, end)
    return figure


def _errors(comparison: Comparison, when: str) -> tuple[np.ndarray, ...]:
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


def _mean_arrows(axes: Axes, row: np.ndarray, start: np.ndarray, end: np.ndarray) -> None:
    """Draw the mean error of the trials in every cell of the board as a bold arrow."""
    if not len(start):
        return
    span = float(np.ptp(start, axis=0).max()) or 1.0
    cell = MaxNLocator(_CELLS, steps=_ROUND).tick_values(0, span)[1]
    _, group = np.unique(np.floor(start / cell), axis=0, return_inverse=True)
    inside = [group.ravel() == index for index in range(int(group.max()) + 1)]
    inside = [cell for cell in inside if len(np.unique(row[cell])) >= _FEWEST]
    if inside:
        tails, heads = (np.array([p[cell].mean(axis=0) for cell in inside]) for p in (start, end))
        board_arrows(axes, tails, heads - tails, INK)
        axes.plot(tails[:, 1], tails[:, 0], "o", color=INK, ms=3.8, mew=0)


@style(on_page=True)
def _player(comparison: Comparison) -> tuple[Figure, list[dict[str, Any]]]:
    """Return the frame of all paths, and every trial's paths in pixels of it, lane by lane."""
    figure, axes = _frame(comparison, 560)
    height = 72 * figure.get_figheight()

    def lanes(some: Mapping[str, Any], of: str) -> list[list[list[float]]]:
        path = np.array(some[of], dtype=float)
        pairs = [path[:, ::-1]]
        if not comparison["words"]["plane"]:
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

    A board is seen by its robot; signals of another kind run over time. `key` pixels are left free
    above.
    """
    trials, named = comparison["trials"], comparison["words"]["axes"]
    low, high = _bounds(trials, len(named))
    labels = [
        axis["name"]
        + (f" [{axis['unit']}]" if axis["unit"] else "")
        + (f", larger {axis['above']}" if axis["above"] else "")
        for axis in named
    ]
    if comparison["words"]["plane"]:
        return board_canvas(low, high, width, labels, above=8 + key)
    figure, axes = canvas(width, 0.62 * width + key, 50, 8, 8 + key, 42)
    first, last = min(t["times_s"][0] for t in trials), max(t["times_s"][-1] for t in trials)
    axes.set(xlim=(first, max(last, first + 1e-9)), ylim=(low.min(), high.max()))
    axes.set(xlabel="time [s]", ylabel=", ".join(labels))
    axes.spines[["top", "right"]].set_visible(True)
    return figure, axes


def _bounds(trials: Any, d: int) -> np.ndarray:
    """Return low and high of every component with a margin, (2, d)."""
    measured = np.concatenate([np.array(t["measured"]) for t in trials])
    low, high = measured.min(axis=0), measured.max(axis=0)
    kept = [np.array(t["predicted"]) for t in trials if not t["diverged"]]
    if kept:
        inner = np.quantile(np.concatenate(kept), (_STRAY, 1 - _STRAY), axis=0)
        low, high = np.minimum(low, inner[0]), np.maximum(high, inner[1])
    span = np.maximum(high - low, 1e-6)
    # a motion along a line still gets a frame with some width
    span = np.maximum(span, 0.2 * span.max()) if d == 2 else span
    return (low + high) / 2 + 0.55 * np.array([[-1], [1]]) * span
