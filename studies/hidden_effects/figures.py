"""The confusion matrix and the power curve."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import binomtest

from robotcast.reporting.names import effect_name
from robotcast.reporting.style import BLUE, GREY, VERMILION, log_marks
from studies.hidden_effects.outcomes import Outcome

ENDS = ("none", "unknown")
CONTROL, OUTSIDE = "none", "outside the library"
BIN_EDGES = (0.0, 1.5, 2.5, 4.0, np.inf)  # in noise floors
_TICKS = (0.5, 1, 2, 3, 5, 10, 20)
ONE_SIGMA = 0.6826894921370859


def confusion_counts(outcomes: Sequence[Outcome]) -> tuple[list[str], list[str], np.ndarray]:
    """Return what was hidden (rows), what was named first (columns) and how often.

    Cases with two effects and cases without a diagnosis are left out.
    """
    cases = [(o, o.diagnosis.names[0]) for o in outcomes if o.kind != "pair" and o.diagnosis]
    hidden = {"control": CONTROL, "outside": OUTSIDE}
    pairs = [(hidden.get(o.kind) or next(iter(o.effects)), name) for o, name in cases]
    effects = sorted({next(iter(o.effects)) for o, _ in cases if o.kind == "single"})
    others = sorted({said for _, said in pairs} - {*effects, *ENDS})
    rows = [*effects, *(end for end in (CONTROL, OUTSIDE) if any(h == end for h, _ in pairs))]
    columns = [*effects, *others, *ENDS]
    counts = np.zeros((len(rows), len(columns)), int)
    for hidden, said in pairs:
        counts[rows.index(hidden), columns.index(said)] += 1
    return rows, columns, counts


def confusion_figure(outcomes: Sequence[Outcome]) -> Figure:
    """Draw how often each effect was named where each was hidden."""
    rows, columns, counts = confusion_counts(outcomes)
    figure = Figure(figsize=(0.55 * len(columns) + 2.6, 0.4 * len(rows) + 2.2))
    axes = figure.subplots()
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    if rows:
        axes.imshow(shares, cmap="Blues", vmin=0, vmax=1, aspect="auto")
    for (row, column), count in np.ndenumerate(counts):
        if count:
            dark = shares[row, column] > 0.55
            axes.text(column, row, str(count), ha="center", va="center", color="w" if dark else "k")
    axes.set_xticks(range(len(columns)), [*map(effect_name, columns)], rotation=40, ha="right")
    axes.set_yticks(range(len(rows)), [*map(effect_name, rows)])
    title = "Cases with at most one hidden effect"
    axes.set(xlabel="named first", ylabel="hidden", title=title)
    return figure


def power_bins(outcomes: Sequence[Outcome]) -> list[tuple[float, int, int]]:
    """Return (mean shift in noise floors, named right, cases) of single effects by their shift."""
    shift, right = _shifts(outcomes)
    place = np.digitize(shift, BIN_EDGES[1:-1])
    return [
        (float(shift[place == k].mean()), int(right[place == k].sum()), int((place == k).sum()))
        for k in range(len(BIN_EDGES) - 1)
        if (place == k).any()
    ]


def power_figure(outcomes: Sequence[Outcome]) -> Figure:
    """Draw how often an effect is named against how far it moves the paths."""
    figure = Figure(figsize=(5.6, 3.6))
    axes = figure.subplots()
    shift, right = _shifts(outcomes)
    nudge = 0.03 * (((np.arange(len(shift)) * 0.618) % 1) - 0.5)
    axes.plot(shift, right + nudge, "o", color=GREY, ms=4, alpha=0.5, mew=0, label="one case")
    if bins := power_bins(outcomes):
        x, rates = [b[0] for b in bins], [b[1] / b[2] for b in bins]
        spans = [binomtest(b[1], b[2]).proportion_ci(ONE_SIGMA, "wilson") for b in bins]
        away = np.abs(np.array(spans).T - rates)
        axes.errorbar(
            x, rates, yerr=away, fmt="o-", color=BLUE, ms=5, capsize=3, label="share (68 %)"
        )
    axes.axvline(1.0, color=VERMILION, lw=1.0, ls=(0, (2, 2)), label="noise floor")
    axes.set_xscale("log")
    log_marks(axes.xaxis, _TICKS)
    axes.set(ylim=(-0.08, 1.08), ylabel="named first")
    axes.set_xlabel("shift of the paths by the hidden effect [noise floors]")
    axes.set_title("How strong an effect must be to be named")
    figure.legend(loc="outside lower center", ncols=3)
    return figure


def _shifts(outcomes: Sequence[Outcome]) -> tuple[np.ndarray, np.ndarray]:
    """Return shift in noise floors and whether it was named first, (n,) each, of single effects."""
    found = [
        (o.shift_percent / said.noise_floor_percent, said.names[0] in o.effects)
        for o in outcomes
        if o.kind == "single" and (said := o.diagnosis) and said.noise_floor_percent
    ]
    return np.array([shift for shift, _ in found]), np.array([right for _, right in found], float)
