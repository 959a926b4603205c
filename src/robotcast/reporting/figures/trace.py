"""How tuning went: the best error found against the casts simulated."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robotcast.reporting.figures.style import CYCLE, GREY
from robotcast.reporting.names import (
    cable_name,
    rig_names,
    thousands,
)
from robotcast.reporting.results import Tuning

_DOTTED = (0, (1, 2))


def trace_figure(tunings: Sequence[Tuning], floors: dict[str, float | None]) -> Figure:
    """Draw one panel a cable and one line a tuning, whose colour tells how it was tuned.

    Parameters
    ----------
    floors : cable → noise floor of the average waypoint error in % of cable length.
    """
    cables = sorted({t.cable for t in tunings})
    methods = sorted({t.method for t in tunings})
    figure = Figure(figsize=(7.2, 3.8))
    panels = figure.subplots(1, len(cables), sharex=True, sharey=True, squeeze=False)[0]
    for axes, cable in zip(panels, cables, strict=True):
        axes.set_title(cable_name(cable))
        for tuning in (t for t in tunings if t.cable == cable):
            number = methods.index(tuning.method)
            _draw(axes, tuning, CYCLE[number % len(CYCLE)])
        floor = floors.get(cable)
        if floor is not None:
            axes.axhline(floor, color=GREY, lw=0.8, ls=_DOTTED, label="noise floor")
        axes.set_xlabel("simulated casts")
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(lambda value, _: thousands(value))
    panels[0].set_ylim(bottom=0)
    panels[0].set_ylabel("best average waypoint error\non tuning casts [% of cable length]")
    rigs = tuple(sorted({t.facts.get("rig", "") for t in tunings} - {""}))
    figure.suptitle(f"Tuned to casts of the {rig_names(rigs)}", fontsize=9.5)
    shown = {
        label: line
        for axes in panels
        for line, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    columns = min(4, len(shown))
    figure.legend(shown.values(), shown.keys(), loc="outside lower center", ncols=columns)
    return figure


def _draw(axes: Axes, tuning: Tuning, color: str) -> None:
    """Draw how one tuning went; a single batch is a point."""
    if tuning.trace is None:
        return
    axes.plot(
        tuning.trace["simulated_casts"].to_numpy(),
        tuning.trace["best_percent"].to_numpy(),
        color=color,
        lw=1.6,
        marker="." if len(tuning.trace) == 1 else "",
        drawstyle="steps-post",
        label=tuning.method,
    )
