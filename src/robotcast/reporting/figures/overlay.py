"""Measured and simulated paths of held-out casts."""

import numpy as np
import polars as pl
from matplotlib.figure import Figure

from robotcast.reporting.figures.style import BLACK, GREY, VERMILION, board_axes, fit_height
from robotcast.reporting.names import cable_name, rig_name
from robotcast.reporting.results import Tuning

_QUANTILES = {"best": 0.0, "quarter": 0.25, "median": 0.5, "three quarters": 0.75, "worst": 1.0}


def overlay_figure(tuning: Tuning, paths: pl.DataFrame, length_m: float) -> Figure:
    """Draw the casts at the quartiles of the average waypoint error, best to worst.

    Parameters
    ----------
    paths : the tuning's `test_paths`.
    """
    casts = _errors(paths, length_m)
    picked = {
        label: casts.row(round(q * (len(casts) - 1)), named=True) for label, q in _QUANTILES.items()
    }
    figure = Figure(figsize=(11, 4))
    axes = figure.subplots(1, len(picked), sharex=True, sharey=True)
    for panel, (label, cast) in zip(axes, picked.items(), strict=True):
        path = paths.filter(pl.col("trial") == cast["trial"]).sort("t")
        measured = path.select("x", "y").to_numpy()
        simulated = path.select("x_predicted", "y_predicted").to_numpy()
        joins = np.stack([measured, simulated])
        panel.plot(joins[:, :, 1], joins[:, :, 0], color="#d1d5db", lw=0.7, zorder=1)
        panel.plot(measured[:, 1], measured[:, 0], "o-", color=BLACK, ms=3, lw=1.0)
        panel.plot(
            simulated[:, 1], simulated[:, 0], "s--", color=VERMILION, ms=2.6, lw=1.2, alpha=0.9
        )
        panel.plot(*measured[-1, ::-1], "*", color=BLACK, ms=10)
        panel.plot(*simulated[-1, ::-1], "*", color=VERMILION, ms=10)
        panel.plot(0, 0, "^", color=GREY, ms=7, clip_on=False)
        panel.set_title(f"{label}\ncast {cast['trial']}: {cast['error']:.1f} %")
        board_axes(panel)
        panel.label_outer()
        if label != "median":
            panel.set_xlabel("")
    rig = rig_name(tuning.facts.get("rig", ""))
    handles = [
        figure.axes[0].plot([], [], "o-", color=BLACK, ms=3, label=f"measured ({rig})"),
        figure.axes[0].plot([], [], "s--", color=VERMILION, ms=3, label="simulated"),
        figure.axes[0].plot([], [], "*", color=GREY, ms=9, label="where the free end rests"),
        figure.axes[0].plot([], [], "^", color=GREY, ms=7, label="robot base"),
    ]
    figure.legend(handles=[h[0] for h in handles], loc="outside lower center", ncols=4)
    told = "average waypoint error in % of cable length"
    figure.suptitle(f"{cable_name(tuning.cable)} · {tuning.method} · {told}", fontsize=10)
    fit_height(figure, panel_in=1.8, around_in=1.6)
    return figure


def _errors(paths: pl.DataFrame, length_m: float) -> pl.DataFrame:
    """Return each trial's average waypoint error in % of cable length, lowest first."""
    distance = (
        (pl.col("x") - pl.col("x_predicted")).pow(2) + (pl.col("y") - pl.col("y_predicted")).pow(2)
    ).sqrt()
    return (
        paths.group_by("trial")
        .agg((100 / length_m * distance.mean()).alias("error"))
        .sort("error", "trial")
    )
