"""The report's figures: how tuning went, what tuned models predict, where policies' casts end."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse, Polygon, Wedge

from robotcast.policies.datasets import Examples
from robotcast.policies.targets import reachable_outline, tool_sector
from robotcast.reporting.names import (
    cable_name,
    math_text,
    policy_label,
    rig_name,
    rig_names,
    thousands,
)
from robotcast.reporting.results import CableData, Evaluation, Tuning, endpoints_by_target
from robotcast.reporting.style import (
    BLACK,
    BLUE,
    CYCLE,
    GREY,
    ORANGE,
    VERMILION,
    board_axes,
    fit_height,
    log_marks,
)

_QUANTILES = {"best": 0.0, "quarter": 0.25, "median": 0.5, "three quarters": 0.75, "worst": 1.0}
_BESIDE_M = 0.25  # what is shown beyond the axis of symmetry
_UNSEEN: dict[str, Any] = {"mfc": "none", "mew": 0.8}
_MEASURED: dict[str, Any] = {"color": BLACK, "marker": "o", "ms": 3, "lw": 1.0}
_SIMULATED: dict[str, Any] = {"color": VERMILION, "marker": "s", "ms": 2.6, "ls": "--", "lw": 1.2}
_CHI2_95 = 5.991  # 95 % quantile of χ² with two degrees of freedom


def trace_figure(tunings: Sequence[Tuning], floors: dict[str, float | None]) -> Figure:
    """Draw the best error found against the casts simulated: a panel a cable, a line a tuning.

    `floors` : cable → noise floor of the average waypoint error in % of cable length.
    """
    cables, methods = sorted({t.cable for t in tunings}), sorted({t.method for t in tunings})
    figure = Figure(figsize=(7.2, 3.8))
    panels = figure.subplots(1, len(cables), sharex=True, sharey=True, squeeze=False)[0]
    shown = {}
    for axes, cable in zip(panels, cables, strict=True):
        axes.set_title(cable_name(cable))
        for tuning in tunings:
            if tuning.cable == cable and tuning.trace is not None:
                trace, color = tuning.trace, CYCLE[methods.index(tuning.method) % len(CYCLE)]
                looks = {"color": color, "lw": 1.6, "marker": "." if len(trace) == 1 else ""}
                casts, best = trace["simulated_casts"], trace["best_percent"]
                (line,) = axes.step(casts.to_numpy(), best.to_numpy(), where="post", **looks)
                shown[tuning.method] = line
        if (floor := floors.get(cable)) is not None:
            shown["noise floor"] = axes.axhline(floor, color=GREY, lw=0.8, ls=(0, (1, 2)))
        axes.set(xlabel="simulated casts", xscale="log")
        axes.xaxis.set_major_formatter(lambda value, _: thousands(value))
    panels[0].set_ylim(bottom=0)
    panels[0].set_ylabel("best average waypoint error\non tuning casts [% of cable length]")
    rigs = rig_names(t.facts.get("rig", "") for t in tunings)
    figure.suptitle(f"Tuned to casts of the {rigs}", fontsize=9.5)
    place = {"loc": "outside lower center", "ncols": min(4, len(shown))}
    figure.legend(shown.values(), shown.keys(), **place)
    return figure


def overlay_figure(tuning: Tuning, paths: pl.DataFrame, length_m: float) -> Figure:
    """Draw measured and simulated `test_paths` of the casts at the quartiles of the error."""
    x, y = ((pl.col(k) - pl.col(f"{k}_predicted")).pow(2) for k in "xy")
    error = (100 / length_m * (x + y).sqrt().mean()).alias("error")
    casts = paths.group_by("trial").agg(error).sort("error", "trial")
    count = len(_QUANTILES)
    figure, panels = _boards(count, 11 / count, columns=count)
    for panel, (label, quantile) in zip(panels, _QUANTILES.items(), strict=True):
        cast = casts.row(round(quantile * (len(casts) - 1)), named=True)
        path = paths.filter(pl.col("trial") == cast["trial"]).sort("t")
        measured = path.select("x", "y").to_numpy()
        simulated = path.select("x_predicted", "y_predicted").to_numpy()
        joins = np.stack([measured, simulated])
        panel.plot(joins[:, :, 1], joins[:, :, 0], color="#d1d5db", lw=0.7, zorder=1)
        for places, looks in ((measured, _MEASURED), (simulated, _SIMULATED)):
            panel.plot(places[:, 1], places[:, 0], **looks)
            panel.plot(*places[-1, ::-1], "*", color=looks["color"], ms=10)
        _finish(panel, f"{label}\ncast {cast['trial']}: {cast['error']:.1f} %")
        if label != "median":
            panel.set_xlabel("")
    rig = rig_name(tuning.facts.get("rig", ""))
    keys = [
        Line2D([], [], label=f"measured ({rig})", **_MEASURED),
        Line2D([], [], label="simulated", **_SIMULATED),
        _key("*", "where the free end rests", GREY, 9),
        _key("^", "robot base", BLACK, 7),
    ]
    figure.legend(handles=keys, loc="outside lower center", ncols=4)
    what = "average waypoint error in % of cable length"
    figure.suptitle(f"{cable_name(tuning.cable)} · {tuning.method} · {what}", fontsize=10)
    fit_height(figure, around_in=1.8)
    return figure


def _boards(count: int, width_in: float, columns: int = 4) -> tuple[Figure, list[Axes]]:
    """Return a figure of so many boards on the same axes, each so wide."""
    columns = min(columns, count)
    rows = -(-count // columns)
    figure = Figure(figsize=(max(6.8, width_in * columns), 4.0 * rows))
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for unused in panels[count:]:
        unused.remove()
    return figure, list(panels[:count])


def _finish(panel: Axes, title: str) -> None:
    """Mark the robot's base, and say what the panel is and what its axes are."""
    panel.plot(0, 0, "k^", ms=7, clip_on=False, zorder=5)
    panel.set_title(math_text(title))
    board_axes(panel)
    panel.label_outer()
    panel.tick_params(labelbottom=True)  # what stands below may be empty


def _key(marker: str, label: str, color: str = "#374151", size: float = 4, **looks: Any) -> Line2D:
    """Return what a legend shows of markers."""
    return Line2D([], [], marker=marker, ls="", color=color, ms=size, label=label, **looks)


def errors_figure(evaluations: Sequence[Evaluation], floors: dict[str, float | None]) -> Figure:
    """Draw every cast's error, with quartiles, one column an evaluation, grouped by cable.

    `floors` : cable → noise floor of the final distance in % of cable length.
    """
    cables = list(dict.fromkeys(e.cable for e in evaluations))
    figure = Figure(figsize=(max(5.0, 1.15 * len(evaluations) + 2.2), 4.0))
    axes = figure.subplots()
    golden = (np.sqrt(5) - 1) / 2
    for place, evaluation in enumerate(evaluations):
        errors = np.sort(np.maximum(evaluation.errors_percent, 0.1))
        beside = 0.5 * ((np.arange(len(errors)) * golden) % 1 - 0.5)  # neighbours stand apart
        color = CYCLE[cables.index(evaluation.cable) % len(CYCLE)]
        axes.plot(place + beside, errors, "o", color=color, ms=3, alpha=0.55, mew=0)
        low, middle, high = np.percentile(errors, [25, 50, 75])
        axes.plot([place, place], [low, high], color=BLACK, lw=5, alpha=0.35, solid_capstyle="butt")
        axes.plot([place - 0.3, place + 0.3], [middle, middle], color=BLACK, lw=1.8)
        axes.text(place + 0.33, middle, f"{middle:.1f} %", va="center", fontsize=8.5)
        if floor := floors.get(evaluation.cable):
            span = [place - 0.45, place + 0.45]
            axes.plot(span, [floor, floor], color=GREY, lw=1.2, ls=(0, (2, 2)))
    axes.set_yscale("log")
    log_marks(axes.yaxis)
    axes.grid(axis="y", color="#e5e7eb", lw=0.6)
    axes.set_axisbelow(True)
    axes.set_xlim(-0.6, len(evaluations) - 0.2)
    labels = [f"{policy_label(e.policy, e.dataset)}\n{cable_name(e.cable)}" for e in evaluations]
    axes.set_xticks(range(len(labels)), [math_text(n.replace(", ", "\n")) for n in labels])
    axes.set_ylabel("final distance to target\n[% of cable length]")
    axes.set_title(f"Errors on the {rig_names(e.rig for e in evaluations)}")
    handles = [
        _key("o", "one cast", BLUE, alpha=0.6),
        Line2D([], [], color=BLACK, lw=1.8, label="median"),
        Line2D([], [], color=BLACK, lw=5, alpha=0.35, label="quartiles"),
    ]
    if any(floors.get(c) for c in cables):
        handles.append(Line2D([], [], color=GREY, lw=1.2, ls=(0, (2, 2)), label="noise floor"))
    figure.legend(handles=handles, loc="outside lower center", ncols=4)
    return figure


def targets_figure(evaluations: Sequence[Evaluation], cables: Sequence[CableData | None]) -> Figure:
    """Draw targets with endpoints and ellipses over the reachable area, a panel an evaluation.

    As the paper's figure repeat_multi_cable.
    """
    figure, panels = _boards(len(evaluations), 3.7)
    repeated = False
    for panel, evaluation, cable in zip(panels, evaluations, cables, strict=True):
        if cable and cable.simulated:
            _draw_areas(panel, cable.simulated)
        for number, target, ends in endpoints_by_target(evaluation.casts):
            _draw_target(panel, target, ends, CYCLE[number % len(CYCLE)])
            repeated |= len(ends) > 2
        for x, y in evaluation.unseen_m:
            panel.plot(y, x, "*", color="#374151", ms=10, zorder=4, **_UNSEEN)
        name, policy, data = evaluation.named
        on = "" if evaluation.dataset == "none" else f" on {data}"
        median = f"median {evaluation.median_percent:.1f} % of cable length"
        _finish(panel, f"{name} · {policy}{on}\n{rig_name(evaluation.rig)}, {median}")
    _show_tested_half(panels[0], evaluations)
    handles = _handles(repeated, any(e.unseen_m for e in evaluations))
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    fit_height(figure, around_in=1.7)
    return figure


def confidence_ellipse(points_m: np.ndarray) -> tuple[np.ndarray, float, float, float]:
    """Return centre (2,), full axes [m] and angle [rad] of the 95 % ellipse of points (n, 2).

    The ellipse holds 95 % of a normal distribution with the points' mean and covariance.
    """
    values, vectors = np.linalg.eigh(np.cov(points_m.T))
    small, large = 2 * np.sqrt(_CHI2_95 * np.maximum(values, 0))
    angle = float(np.arctan2(vectors[1, 1], vectors[0, 1]))
    return points_m.mean(axis=0), float(large), float(small), angle


def _draw_areas(panel: Axes, simulated: Examples) -> None:
    """Shade where the free end can rest, and the sector that the robot's hand sweeps."""
    outline = reachable_outline(simulated.endpoints_m)
    panel.add_patch(Polygon(outline[:, ::-1], fc="#e5e7eb", ec="#9ca3af", lw=0.8, zorder=0))
    inner_m, outer_m, half_rad = tool_sector(simulated.actions)
    half = np.degrees(half_rad)
    looks = {"fc": "#fde68a", "ec": ORANGE, "lw": 0.8, "alpha": 0.75, "zorder": 1}
    ends = 90 - half, 90 + half
    panel.add_patch(Wedge((0, 0), outer_m, *ends, width=outer_m - inner_m, **looks))
    panel.update_datalim(outline[:, ::-1])
    panel.autoscale_view()


def _show_tested_half(panel: Axes, evaluations: Sequence[Evaluation]) -> None:
    """Cut off the half of the board without targets; it would be a mirror image."""
    sides = {float(np.sign(y)) for e in evaluations for y in e.casts["target_y"]}
    right, left = sorted(panel.get_xlim())
    if len(sides) == 1:
        right, left = (-_BESIDE_M, left) if sides == {1.0} else (right, _BESIDE_M)
    panel.set_xlim(left, right)


def _draw_target(panel: Axes, target: np.ndarray, ends: np.ndarray, color: str) -> None:
    panel.plot(ends[:, 1], ends[:, 0], "o", color=color, ms=3.2, alpha=0.85, mew=0, zorder=3)
    panel.plot(*target[::-1], "*", color=color, ms=10, mec="white", mew=0.6, zorder=4)
    centre = ends.mean(axis=0)
    if len(ends) > 2:
        centre, large, small, angle = confidence_ellipse(ends)
        looks = {"fc": color, "ec": color, "alpha": 0.25, "lw": 0, "zorder": 2}
        turn = 90 - np.degrees(angle)
        panel.add_patch(Ellipse(tuple(centre[::-1]), large, small, angle=turn, **looks))
    line = np.stack([centre, target])
    panel.plot(line[:, 1], line[:, 0], "--", color=color, lw=1.0, zorder=3)


def _handles(ellipses: bool, unseen: bool) -> list:
    """Return what the legend explains."""
    ellipse = Polygon([(0, 0)], fc="#374151", alpha=0.25, label="95 % ellipse of the repeats")
    lost = _key("*", "all casts lost in tracking", size=10, **_UNSEEN)
    return [
        _key("*", "target", size=10),
        _key("o", "where the free end came to rest"),
        *([ellipse] if ellipses else []),
        Line2D([], [], color="#374151", ls="--", lw=1, label="mean endpoint to target"),
        Polygon([(0, 0)], fc="#e5e7eb", ec="#9ca3af", label="reachable by the free end"),
        Polygon([(0, 0)], fc="#fde68a", ec=ORANGE, label="swept by the robot’s hand"),
        *([lost] if unseen else []),
    ]
