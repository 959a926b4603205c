"""How tuning went: the best error found against the casts simulated."""

from collections.abc import Sequence

from matplotlib.figure import Figure

from robotcast.reporting.figures.style import CYCLE, GREY
from robotcast.reporting.names import (
    cable_name,
    optimizer_name,
    rig_names,
    simulator_name,
    thousands,
)
from robotcast.reporting.results import Tuning

_DASHES = ("-", "--", ":", "-.")
_DOTTED = (0, (1, 2))


def trace_figure(tunings: Sequence[Tuning], floors: dict[str, float | None]) -> Figure:
    """Draw one line a tuning: colour tells the cable, dashes the simulator and optimizer.

    Parameters
    ----------
    floors : cable → noise floor of the average waypoint error in % of cable length.
    """
    figure = Figure(figsize=(7.2, 3.8))
    axes = figure.subplots()
    cables = sorted({t.cable for t in tunings})
    methods = sorted({(t.simulator, t.optimizer) for t in tunings})
    for tuning in tunings:
        if tuning.trace is None:
            continue
        method = (tuning.simulator, tuning.optimizer)
        color = CYCLE[cables.index(tuning.cable) % len(CYCLE)]
        label = cable_name(tuning.cable)
        if len(methods) > 1:
            label += f", {simulator_name(method[0])} {optimizer_name(method[1])}"
        axes.plot(
            tuning.trace["simulated_casts"].to_numpy(),
            tuning.trace["best_percent"].to_numpy(),
            _DASHES[methods.index(method) % len(_DASHES)],
            color=color,
            lw=1.6,
            drawstyle="steps-post",
            label=label,
        )
    for cable in cables:
        floor = floors.get(cable)
        if floor is not None:
            axes.axhline(floor, color=CYCLE[cables.index(cable) % len(CYCLE)], lw=0.8, ls=_DOTTED)
    if any(f is not None for f in floors.values()):
        axes.plot([], [], color=GREY, lw=0.8, ls=_DOTTED, label="noise floor (same colour)")
    axes.set_ylim(bottom=0)
    axes.set_xlim(left=0)
    axes.set_xlabel("simulated casts")
    axes.set_ylabel("best average waypoint error\non tuning casts [% of cable length]")
    rigs = tuple(sorted({t.facts.get("rig", "") for t in tunings} - {""}))
    named = ", ".join(f"{simulator_name(s)} by {optimizer_name(o)}" for s, o in methods)
    axes.set_title(f"{named}, against casts of the {rig_names(rigs)}")
    axes.xaxis.set_major_formatter(lambda value, _: thousands(value))
    axes.legend(loc="upper right")
    return figure
