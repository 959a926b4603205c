"""The study's table: parameter error, waypoint error and casts used, beside the paper's ranges."""

import csv
import io
from collections.abc import Iterable, Sequence

import numpy as np

from robotcast.reporting.names import optimizer_name, simulator_name, thousands
from robotcast.reporting.paper import SIM2SIM, SIM2SIM_CASTS
from robotcast.sim2sim.outcome import Outcome

MISSING = "–"
NEAR_PERCENT = 1.0  # the paper's bar: a tuning is near when its parameters are within this
HEAD = (
    "Simulator", "Casts", "Optimizer", "Tunings", "Parameters told", "Parameter error [%]",
    "Worst [%]", "Within 1 %", "Waypoint error [%]", "Simulated casts, at most", "Paper [%]",
)  # fmt: skip

Rows = Sequence[Sequence[str]]


def rows(outcomes: Iterable[Outcome], told_percent: float) -> Rows:
    """Return the table, its head first.

    Parameters
    ----------
    told_percent : a parameter counts where the casts tell it within this share of its value.
    """
    cells: dict[tuple[str, int, str], list[Outcome]] = {}
    for outcome in outcomes:
        cell = (outcome.simulator, outcome.casts, outcome.optimizer)
        cells.setdefault(cell, []).append(outcome)
    return [HEAD, *(_row(*cell, cells[cell], told_percent) for cell in sorted(cells))]


def markdown(table: Rows) -> str:
    """Write the table for people."""
    lines = [table[0], ["---"] * len(table[0]), *table[1:]]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def csv_text(table: Rows) -> str:
    """Write the table as CSV, empty where nothing is known."""
    text = io.StringIO()
    plain = [[c.replace("\u202f", "").replace(MISSING, "") for c in row] for row in table[1:]]
    csv.writer(text, lineterminator="\n").writerows([table[0], *plain])
    return text.getvalue()


def _row(
    simulator: str, casts: int, optimizer: str, outcomes: Sequence[Outcome], told_percent: float
) -> list[str]:
    tunings: dict[tuple[str, str, int, int, int], list[Outcome]] = {}
    for outcome in outcomes:
        tunings.setdefault(outcome.tuning, []).append(outcome)
    told = [o for o in outcomes if o.told_within_percent <= told_percent]
    shown = [
        [o.error_percent for o in one if o.told_within_percent <= told_percent]
        for one in tunings.values()
    ]
    worst = [max(errors) for errors in shown if errors]
    firsts = [one[0] for one in tunings.values()]
    near = sum(error <= NEAR_PERCENT for error in worst)
    return [
        simulator_name(simulator),
        str(casts),
        optimizer_name(optimizer),
        str(len(tunings)),
        f"{len(told)} of {len(outcomes)}",
        _number(np.median(worst) if worst else np.nan),
        _number(max(worst, default=np.nan)),
        f"{near} of {len(worst)}",
        _number(np.median([o.test_percent for o in firsts])),
        thousands(max(o.simulated_casts for o in firsts)),
        _paper(simulator, optimizer, casts),
    ]


def _number(value: float) -> str:
    return MISSING if np.isnan(value) else f"{value:.3g}"


def _paper(simulator: str, optimizer: str, casts: int) -> str:
    """Return the paper's range; of Bayesian optimization it has one over all acquisitions."""
    family = optimizer.split("_")[0]
    low, high = SIM2SIM.get(simulator, {}).get(family, (None, None))
    if high is None or (family == "bo" and casts != SIM2SIM_CASTS):
        return MISSING
    return f"< {high:g}" if low is None else f"{low:g} to {high:g}"
