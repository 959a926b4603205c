"""How the errors of policies are distributed."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from robotcast.reporting.figures.style import BLACK, BLUE, CYCLE, GREY, math_text
from robotcast.reporting.names import cable_name, policy_label, rig_names
from robotcast.reporting.results import Evaluation

_TICKS = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200)


def errors_figure(evaluations: Sequence[Evaluation], floors: dict[str, float | None]) -> Figure:
    """Draw every cast's error, with quartiles, one column an evaluation, grouped by cable.

    Parameters
    ----------
    floors : cable → noise floor of the final distance in % of cable length.
    """
    cables = list(dict.fromkeys(e.cable for e in evaluations))
    figure = Figure(figsize=(max(5.0, 1.15 * len(evaluations) + 2.2), 4.0))
    axes = figure.subplots()
    for place, evaluation in enumerate(evaluations):
        errors = np.sort(np.maximum(evaluation.errors_percent, _TICKS[0]))
        color = CYCLE[cables.index(evaluation.cable) % len(CYCLE)]
        axes.plot(place + _spread(len(errors)), errors, "o", color=color, ms=3, alpha=0.55, mew=0)
        low, middle, high = np.percentile(errors, [25, 50, 75])
        axes.plot([place, place], [low, high], color=BLACK, lw=5, alpha=0.35, solid_capstyle="butt")
        axes.plot([place - 0.3, place + 0.3], [middle, middle], color=BLACK, lw=1.8)
        axes.annotate(
            f"{middle:.1f} %", (place + 0.33, middle), ha="left", va="center", fontsize=8.5
        )
        floor = floors.get(evaluation.cable)
        if floor:
            span = [place - 0.45, place + 0.45]
            axes.plot(span, [floor, floor], color=GREY, lw=1.2, ls=(0, (2, 2)))
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(FixedLocator(list(_TICKS)))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.grid(axis="y", color="#e5e7eb", lw=0.6)
    axes.set_axisbelow(True)
    axes.set_xlim(-0.6, len(evaluations) - 0.2)
    axes.set_xticks(
        range(len(evaluations)),
        [
            math_text(
                f"{policy_label(e.policy, e.dataset)}\n{cable_name(e.cable)}".replace(", ", "\n")
            )
            for e in evaluations
        ],
    )
    axes.set_ylabel("final distance to target\n[% of cable length]")
    axes.set_title(f"Errors on the {rig_names(tuple(sorted({e.rig for e in evaluations})))}")
    handles = [
        axes.plot([], [], "o", color=BLUE, ms=4, alpha=0.6, label="one cast")[0],
        axes.plot([], [], color=BLACK, lw=1.8, label="median")[0],
        axes.plot([], [], color=BLACK, lw=5, alpha=0.35, label="quartiles")[0],
    ]
    if any(floors.get(c) for c in cables):
        handles += axes.plot([], [], color=GREY, lw=1.2, ls=(0, (2, 2)), label="noise floor")
    figure.legend(handles=handles, loc="outside lower center", ncols=4)
    return figure


def _spread(count: int) -> np.ndarray:
    """Return sideways places (count,) that keep neighbouring points apart, the same each time."""
    golden = (np.sqrt(5) - 1) / 2
    return 0.5 * ((np.arange(count) * golden) % 1 - 0.5)
