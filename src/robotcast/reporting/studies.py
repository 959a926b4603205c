"""Tables and figures of the studies: what more casts, real ones and a better model are worth."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, NullLocator

from robotcast.reporting.names import dataset_name, policy_name, simulator_name
from robotcast.reporting.results import Evaluation, Tuning
from robotcast.reporting.style import BLUE, GREY, VERMILION, math_text

HEAD = ("median", "from", "to", "q1", "q3", "scatter", "casts")
CHANGE_HEAD = ("Policy", "its median error", "from", "to")
SIZE_HEAD = (
    "Simulator",
    "Casts tuned to",
    "Simulated casts",
    "Waypoint error on them",
    "Held-out waypoint error",
    "Held-out final error",
    "Change",
    "from",
    "to",
)
_DRAWS, _SEED = 4000, 0


@dataclass(frozen=True)
class Point:
    """One policy of a study.

    Attributes
    ----------
    group : what the policy is compared by, such as its dataset.
    place : where it stands, a number of casts or the rung of a ladder.
    """

    group: str
    place: float
    evaluation: Evaluation

    @property
    def numbers(self) -> tuple[float, ...]:
        """Return `HEAD`: median, its 95 % interval, quartiles and scatter of repeats, and casts.

        All but the casts are in % of cable length.
        """
        errors = self.evaluation.errors_percent
        low, high = self.evaluation.median_interval or (np.nan, np.nan)
        middle, q1, q3 = np.percentile(errors, [50, 25, 75])
        scatter = self.evaluation.scatter_percent
        apart = np.nan if scatter is None else scatter
        return (*(float(v) for v in (middle, low, high, q1, q3, apart)), len(errors))


def change_rows(points: Sequence[Point]) -> list[tuple[str, str, str, str]]:
    """Return `CHANGE_HEAD` for every group: from its first place to its last, with the interval."""
    rows = []
    for group in dict.fromkeys(p.group for p in points):
        of = sorted((p for p in points if p.group == group), key=lambda p: p.place)
        if len(of) > 1:
            change = of[-1].evaluation.change_from(of[0].evaluation)
            rows.append((policy_name("nn", group), *(f"{100 * share:+.0f} %" for share in change)))
    return rows


def markdown(columns: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Return a table in Markdown; numbers get one decimal, and no zero a minus."""

    def text(cell: object) -> str:
        return f"{cell:z.1f}" if isinstance(cell, float) else str(cell)

    lines = [columns, ["---"] * len(columns), *([text(c) for c in row] for row in rows)]
    return "".join("| " + " | ".join(line) + " |\n" for line in lines)


def real_casts_figure(points: Sequence[Point]) -> Figure:
    """Draw the median error with its interval against the number of real casts."""
    figure = Figure(figsize=(6.0, 3.6))
    axes = figure.subplots()
    for group, color in zip(sorted({p.group for p in points}), (BLUE, VERMILION), strict=False):
        of = sorted((p for p in points if p.group == group), key=lambda p: p.place)
        numbers = np.array([p.numbers for p in of])
        places = [p.place for p in of]
        name = f"{policy_name('nn', group)} on {dataset_name(group)}"
        axes.plot(places, numbers[:, 0], "o-", color=color, label=math_text(name))
        axes.vlines(places, numbers[:, 1], numbers[:, 2], color=color, lw=1.2)
    places = sorted({p.place for p in points})
    axes.set_xscale("log")
    axes.set_xticks(places, [f"{n:.0f}" for n in places])
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_ylim(bottom=0)
    axes.set_xlabel("real casts to learn from")
    axes.set_ylabel("median error\n[% of cable length]")
    figure.legend(loc="outside lower center", ncols=2)
    return figure


def ladder_figure(models: dict[str, float], points: Sequence[Point]) -> Figure:
    """Draw both error ladders: of the model on held-out casts, of its policies at the targets.

    Parameters
    ----------
    models : name → average waypoint error on held-out casts in % of cable length.
    """
    figure = Figure(figsize=(7.4, 3.2))
    left, right = figure.subplots(1, 2)
    names = list(models)
    left.barh(names, list(models.values()), color=GREY, height=0.5)
    left.invert_yaxis()
    left.set_xlabel("waypoint error, held-out casts [%]")
    left.set_title("Model")
    groups = sorted({p.group for p in points})
    for k, (group, color) in enumerate(zip(groups, (BLUE, VERMILION), strict=False)):
        of = sorted((p for p in points if p.group == group), key=lambda p: p.place)
        numbers = np.array([p.numbers for p in of])
        places = np.array([p.place for p in of]) + 0.3 * (k - (len(groups) - 1) / 2)
        right.barh(
            places, numbers[:, 0], 0.26, color=color, label=math_text(policy_name("nn", group))
        )
        right.hlines(places, numbers[:, 1], numbers[:, 2], color="black", lw=1.2)
    right.set_yticks(range(len(names)), names)
    right.invert_yaxis()
    right.set_xlabel("median distance to the target [%]")
    right.set_title("Policy")
    figure.legend(loc="outside lower center", ncols=2)
    return figure


def size_rows(tunings: Sequence[Tuning]) -> list[tuple[object, ...]]:
    """Return `SIZE_HEAD` for every tuning, by simulator and number of casts.

    The change of the held-out waypoint error is against the fewest casts that this simulator was
    tuned to, cast by cast, with its 95 % bootstrap interval over casts (Efron 1979).

    Raises
    ------
    ValueError
        When tunings of one simulator were not judged on the same casts.
    """
    rows: list[tuple[object, ...]] = []
    for simulator in sorted({t.simulator for t in tunings}):
        of = sorted((t for t in tunings if t.simulator == simulator), key=_casts)
        fewest = _cast_errors_percent(of[0])
        for tuning in of:
            errors = _cast_errors_percent(tuning)
            if errors["trial"].to_list() != fewest["trial"].to_list():
                raise ValueError(
                    f"{simulator} tuned to {_casts(tuning)} and to {_casts(of[0])} casts was not "
                    "judged on the same ones: tune both anew"
                )
            change = (errors["percent"] - fewest["percent"]).to_numpy()
            rows.append(
                (
                    simulator_name(simulator),
                    _casts(tuning),
                    tuning.facts["simulated_casts"],
                    tuning.error("tune", "waypoint_percent"),
                    tuning.error("test", "waypoint_percent"),
                    tuning.error("test", "final_percent"),
                    *(("–",) * 3 if tuning is of[0] else _mean_and_interval(change)),
                )
            )
    return rows


def _casts(tuning: Tuning) -> int:
    return tuning.facts["errors"]["tune"]["n_casts"]


def _cast_errors_percent(tuning: Tuning) -> pl.DataFrame:
    """Return every held-out cast's average waypoint error; a diverged run counts one length."""
    if tuning.predictions is None:
        raise ValueError(f"{tuning.simulator}: predictions.parquet is missing, tune anew")
    away = (pl.col("x") - pl.col("x_predicted")) ** 2 + (pl.col("y") - pl.col("y_predicted")) ** 2
    length_m = tuning.facts["cable"]["length_m"]
    return (
        tuning.predictions.filter(pl.col("split") == "test")
        .group_by("trial")
        .agg(percent=(100 * away.sqrt().mean() / length_m).fill_nan(100.0))
        .sort("trial")
    )


def _mean_and_interval(change: np.ndarray) -> tuple[float, float, float]:
    random = np.random.default_rng(_SEED)
    means = change[random.integers(len(change), size=(_DRAWS, len(change)))].mean(axis=1)
    low, high = np.percentile(means, [2.5, 97.5])
    return float(change.mean()), float(low), float(high)
