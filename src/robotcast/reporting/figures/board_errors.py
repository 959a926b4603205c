"""Where on the board policies miss: the median error at every target."""

from collections.abc import Sequence

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from robotcast.reporting.figures.style import board_axes, fit_height, math_text
from robotcast.reporting.names import cable_name, dataset_name, policy_name
from robotcast.reporting.results import Evaluation, endpoints_by_target

_LEAST, _MOST = 1.0, 100.0  # ends of the colours in % of cable length


def board_errors_figure(evaluations: Sequence[Evaluation], columns: int = 4) -> Figure:
    """Draw one panel an evaluation: a disc a target, coloured by its casts' median error."""
    columns = min(columns, len(evaluations))
    rows = -(-len(evaluations) // columns)
    figure = Figure(figsize=(max(6.8, 2.6 * columns), 3.0 * rows))
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    drawn = None
    for panel, evaluation in zip(panels.flat, evaluations, strict=False):
        places, errors = _errors(evaluation)
        drawn = panel.scatter(
            places[:, 1],
            places[:, 0],
            c=np.clip(errors, _LEAST, _MOST),
            cmap="cividis_r",
            norm=LogNorm(_LEAST, _MOST),
            s=130,
            edgecolors="#6b7280",
            linewidths=0.5,
        )
        for (x, y), error in zip(places, errors, strict=True):
            panel.annotate(
                f"{error:.0f}", (y, x), ha="center", va="center", fontsize=6.5
            ).set_color("white" if error > 15 else "black")
        for x, y in evaluation.unseen_m:
            panel.plot(y, x, "o", mfc="none", mec="#6b7280", mew=0.5, ms=np.sqrt(130), ls="none")
            panel.annotate("lost", (y, x), ha="center", va="center", fontsize=5)
        panel.plot(0, 0, "k^", ms=6, clip_on=False)
        name = policy_name(evaluation.policy, evaluation.dataset)
        panel.set_title(
            math_text(f"{cable_name(evaluation.cable)} · {name}\n")
            + math_text(dataset_name(evaluation.dataset))
        )
        board_axes(panel)
        panel.label_outer()
        panel.margins(0.12)
    for panel in panels.flat[len(evaluations) :]:
        panel.set_axis_off()
    if drawn is not None:
        bar = figure.colorbar(drawn, ax=panels, shrink=0.7, ticks=[1, 3, 10, 30, 100])
        bar.ax.set_yticklabels(["≤ 1", "3", "10", "30", "≥ 100"])
        bar.set_label("median error at the target [% of cable length]")
    fit_height(figure, panel_in=max(1.9, 6.0 / columns), around_in=1.2, rows=rows)
    return figure


def _errors(evaluation: Evaluation) -> tuple[np.ndarray, np.ndarray]:
    """Return the targets (k, 2) and the median error at each (k,), in % of cable length."""
    casts = evaluation.casts
    per_metre = float((casts["error_percent"] / casts["error_m"]).median())  # type: ignore[arg-type]
    places, errors = [], []
    for _, target, ends in endpoints_by_target(casts):
        places.append(target)
        errors.append(np.median(np.linalg.norm(ends - target, axis=1)) * per_metre)
    return np.stack(places), np.array(errors)
