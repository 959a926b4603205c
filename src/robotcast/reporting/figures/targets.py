"""Targets with endpoints and ellipses over the reachable area (paper, fig. repeat_multi_cable)."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse, Polygon, Wedge

from robotcast.policies.datasets import Examples
from robotcast.policies.targets import reachable_outline, tool_sector
from robotcast.reporting.figures.style import CYCLE, ORANGE, board_axes, fit_height, math_text
from robotcast.reporting.names import cable_name, dataset_name, policy_name, rig_name
from robotcast.reporting.results import CableData, Evaluation, endpoints_by_target

_BESIDE_M = 0.25  # what is shown beyond the axis of symmetry
_MOST_COLUMNS = 4
_UNSEEN = {"color": "#374151", "ms": 10, "mfc": "none", "mew": 0.8}
_CHI2_95 = 5.991  # 95 % quantile of χ² with two degrees of freedom


def targets_figure(evaluations: Sequence[Evaluation], cables: Sequence[CableData | None]) -> Figure:
    """Draw one panel an evaluation, each over its cable's reachable area."""
    columns = min(_MOST_COLUMNS, len(evaluations))
    rows = -(-len(evaluations) // columns)
    figure = Figure(figsize=(max(6.8, 3.7 * columns), 4 * rows))
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    panels = grid.ravel()[: len(evaluations)]
    for unused in grid.ravel()[len(evaluations) :]:
        unused.remove()
    for panel, evaluation, cable in zip(panels, evaluations, cables, strict=True):
        if cable and cable.simulated:
            _areas(panel, cable.simulated)
        for number, target, ends in endpoints_by_target(evaluation.casts):
            _target(panel, target, ends, CYCLE[number % len(CYCLE)])
        for x, y in evaluation.unseen_m:
            panel.plot(y, x, "*", **_UNSEEN, zorder=4)
        panel.plot(0, 0, "k^", ms=7, clip_on=False, zorder=5)
        median = np.median(evaluation.errors_percent)
        name = policy_name(evaluation.policy, evaluation.dataset)
        data = "" if evaluation.dataset == "none" else f" on {dataset_name(evaluation.dataset)}"
        panel.set_title(
            math_text(f"{cable_name(evaluation.cable)} · {name}{data}\n")
            + f"{rig_name(evaluation.rig)}, median {median:.1f} % of cable length"
        )
        board_axes(panel)
        panel.label_outer()
        panel.tick_params(labelbottom=True)  # what stands below may be empty
    _show_tested_half(panels[0], evaluations)
    repeated = any(
        len(ends) > 2 for e in evaluations for _, _, ends in endpoints_by_target(e.casts)
    )
    unseen = any(e.unseen_m for e in evaluations)
    figure.legend(handles=_handles(repeated, unseen), loc="outside lower center", ncols=3)
    fit_height(figure, panel_in=max(3.2, 6.2 / columns - 0.5), around_in=1.7, rows=rows)
    return figure


def confidence_ellipse(points_m: np.ndarray) -> tuple[np.ndarray, float, float, float]:
    """Return centre (2,), full axes [m] and angle [rad] of the 95 % ellipse of points (n, 2).

    The ellipse holds 95 % of a normal distribution with the points' mean and covariance.
    """
    values, vectors = np.linalg.eigh(np.cov(points_m.T))
    small, large = 2 * np.sqrt(_CHI2_95 * np.maximum(values, 0))
    angle = float(np.arctan2(vectors[1, 1], vectors[0, 1]))
    return points_m.mean(axis=0), float(large), float(small), angle


def _areas(panel: Axes, simulated: Examples) -> None:
    """Shade where the free end can rest, and the sector that the robot's hand sweeps."""
    outline = reachable_outline(simulated.endpoints_m)
    panel.add_patch(Polygon(outline[:, ::-1], fc="#e5e7eb", ec="#9ca3af", lw=0.8, zorder=0))
    sector = tool_sector(simulated.actions)
    half = np.degrees(sector.half_angle_rad)
    panel.add_patch(
        Wedge(
            (0, 0),
            sector.outer_m,
            90 - half,
            90 + half,
            width=sector.outer_m - sector.inner_m,
            fc="#fde68a",
            ec=ORANGE,
            lw=0.8,
            alpha=0.75,
            zorder=1,
        )
    )
    panel.update_datalim(outline[:, ::-1])
    panel.autoscale_view()


def _show_tested_half(panel: Axes, evaluations: Sequence[Evaluation]) -> None:
    """Cut off the half of the board without targets; it would be a mirror image."""
    sides = {float(np.sign(y)) for e in evaluations for y in e.casts["target_y"]}
    right, left = sorted(panel.get_xlim())
    if len(sides) == 1:
        right, left = (-_BESIDE_M, left) if sides == {1.0} else (right, _BESIDE_M)
    panel.set_xlim(left, right)


def _target(panel: Axes, target: np.ndarray, ends: np.ndarray, color: str) -> None:
    panel.plot(ends[:, 1], ends[:, 0], "o", color=color, ms=3.2, alpha=0.85, mew=0, zorder=3)
    panel.plot(*target[::-1], "*", color=color, ms=10, mec="white", mew=0.6, zorder=4)
    centre = ends.mean(axis=0)
    if len(ends) > 2:
        centre, large, small, angle = confidence_ellipse(ends)
        panel.add_patch(
            Ellipse(
                tuple(centre[::-1]),
                large,
                small,
                angle=90 - np.degrees(angle),
                fc=color,
                ec=color,
                alpha=0.25,
                lw=0,
                zorder=2,
            )
        )
    line = np.stack([centre, target])
    panel.plot(line[:, 1], line[:, 0], "--", color=color, lw=1.0, zorder=3)


def _handles(ellipses: bool, unseen: bool) -> list:
    """What the legend explains; without `ellipses` no target has repeats enough for one."""
    axes = Figure().subplots()
    drawn = [
        axes.plot([], [], "*", color="#374151", ms=10, label="target")[0],
        axes.plot([], [], "o", color="#374151", ms=4, label="where the free end came to rest")[0],
        Polygon([(0, 0)], fc="#374151", alpha=0.25, label="95 % ellipse of the repeats"),
        axes.plot([], [], "--", color="#374151", lw=1, label="mean endpoint to target")[0],
        Polygon([(0, 0)], fc="#e5e7eb", ec="#9ca3af", label="reachable by the free end"),
        Polygon([(0, 0)], fc="#fde68a", ec=ORANGE, label="swept by the robot’s hand"),
    ]
    if unseen:
        drawn.append(axes.plot([], [], "*", **_UNSEEN, label="all casts lost in tracking")[0])
    return drawn if ellipses else [*drawn[:2], *drawn[3:]]
