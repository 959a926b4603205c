"""The loop on one cable: where the tuned model fails, what it lacks, and what adding that is worth.

Its prose stands in loop.html, chosen by codes.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl
from markupsafe import Markup
from matplotlib.figure import Figure

from robotcast.reporting.bars import Bar, Row, bars, fall
from robotcast.reporting.names import cable_name, effect_name, number, with_interval, with_unit
from robotcast.reporting.page import block
from robotcast.reporting.results import Evaluation, Results, Tuning, read_evaluation, read_tuning
from robotcast.reporting.style import BLACK, BLUE, GREY, VERMILION, board_axes, inline, style

SHOWN = 3  # casts whose paths are drawn


@dataclass(frozen=True)
class Loop:
    """What the loop's stages wrote.

    Attributes
    ----------
    before, after : the tuned model, and the one revised as the diagnosis says.
    comparison, diagnosis : what compare and diagnose wrote.
    policies : a policy that learned from each of the two models, None where it was not tested.
    hidden : mechanism → its parameters, what the virtual rig hid; None on another rig.
    actions : trial → action, of the cable's casts.
    """

    before: Tuning
    after: Tuning
    comparison: Mapping[str, Any]
    diagnosis: Mapping[str, Any]
    policies: tuple[Evaluation, Evaluation] | None
    hidden: Mapping[str, Mapping[str, float]] | None
    actions: Mapping[int, int]

    @property
    def falls(self) -> tuple[float, float]:
        """Average waypoint error on held-out casts before and after, in % of cable length."""
        before, after = (t.facts["errors"]["test"]["waypoint_percent"] for t in self._models)
        return before, after

    @property
    def _models(self) -> tuple[Tuning, Tuning]:
        return self.before, self.after


def read_loop(folder: Path, results: Results, hidden: Mapping[str, Any] | None) -> Loop | None:
    """Read data/loop; None where its stages have not run.

    Parameters
    ----------
    hidden : the opened answer of the cable's rig, None where nobody sealed one.
    """
    tuned = folder / "tuned" / "tuned.yaml"
    if not tuned.is_file():
        return None
    after = read_tuning(tuned)
    pair = (after.cable, after.simulator, after.optimizer)
    before = next(t for t in results.tunings if (t.cable, t.simulator, t.optimizer) == pair)
    evaluation, first = folder / "evaluation" / "evaluation.csv", None
    revised = None
    if evaluation.is_file():
        revised = read_evaluation(evaluation)
        first = results.evaluation(revised.cable, revised.policy, revised.dataset)
    cable = results.cable(after.cable)
    measured = cable.measured if cable else None
    assert measured is not None
    found = {e["effect"]: e["parameters"] for e in hidden["effects"]} if hidden else None
    return Loop(
        before,
        after,
        _read(folder / "comparison" / "comparison.json"),
        _read(folder / "diagnosis" / "diagnosis.json"),
        (first, revised) if first and revised else None,
        found,
        {trial.trial: trial.action_id for trial in measured.trials},
    )


def _read(path: Path) -> dict[str, Any]:
    return json.loads(path.read_text(encoding="utf-8"))


def loop_block(loop: Loop) -> Markup:
    """Return the loop as the first part of the report's page."""
    verdict = [v for v in loop.diagnosis["verdict"] if v not in ("none", "unknown")]
    floor = loop.diagnosis["noise_floor_percent"]
    axis = "average error on held-out casts [% of cable length]"
    return block(
        "loop.html",
        "loop",
        cable=cable_name(loop.before.cable),
        before=loop.falls[0],
        after=loop.falls[1],
        floor=floor,
        findings=[s["sentence"] for s in loop.comparison["slices"]][:2],
        diagnosis=loop.diagnosis,
        verdict=verdict,
        sizes=[row for name in verdict for row in _sizes(loop, name)],
        paths=inline(_paths(loop), "Measured paths, and those of both models"),
        ladder=inline(bars(_ladder(loop), axis, floor), "Error before and after"),
        targets=loop.policies[0].targets if loop.policies else 0,
        medians=[(e.median_percent, e.median_interval) for e in loop.policies or ()],
        hidden=loop.hidden,
        right=loop.hidden is not None and set(loop.hidden) == set(verdict),
    )


def _ladder(loop: Loop) -> list[Row]:
    before, after = loop.falls
    rows = [Row("tuned model", (Bar(before, "before"),))]
    if loop.after.effects:
        added = " + ".join(effect_name(e) for e in loop.after.effects)
        rows.append(Row(f"+ {added}", (Bar(after, note=fall(before, after)),)))
    return rows


def _sizes(loop: Loop, effect: str) -> list[tuple[str, str, str]]:
    """Return (name, found with interval, hidden) of an effect's parameters."""
    rows = []
    for name, given in loop.diagnosis["model"]["parameters"].items():
        owner, _, parameter = name.partition(".")
        if owner != effect:
            continue
        value, low, high = with_interval(given["value"], given["low"], given["high"])
        unit = given["unit"] or ""
        true = (loop.hidden or {}).get(effect, {}).get(parameter)
        hidden = "–" if true is None else with_unit(number(true), unit)
        words = f"{effect_name(effect)}, {parameter}"
        rows.append((words, f"{with_unit(value, unit)}, between {low} and {high}", hidden))
    return rows


@style(on_page=True)
def _paths(loop: Loop) -> Figure:
    """Draw the held-out casts that the tuned model misses most, with both models' predictions."""
    keys = ["trial", "t"]
    before, after = loop.before.test_paths, loop.after.test_paths
    assert before is not None and after is not None
    columns = ["x_predicted", "y_predicted"]
    both = before.join(after.select(*keys, *columns), on=keys, suffix="_after").sort(keys)
    away = (pl.col("x") - pl.col("x_predicted")) ** 2 + (pl.col("y") - pl.col("y_predicted")) ** 2
    order = both.group_by("trial").agg(error=away.sqrt().mean()).sort("error", descending=True)
    figure = Figure(figsize=(12.4, 4.8), dpi=72, layout="constrained")
    panels = figure.subplots(1, SHOWN, sharex=True, sharey=True, squeeze=False)[0]
    worst = {loop.actions[trial]: trial for trial in reversed(order["trial"])}  # one an action
    shown = [trial for trial in order["trial"] if worst[loop.actions[trial]] == trial][:SHOWN]
    for axes, trial in zip(panels, shown, strict=False):
        path = both.filter(pl.col("trial") == trial)
        lines = (
            (("x", "y"), "o-", BLACK, "measured"),
            (columns, "s--", VERMILION, "tuned model"),
            ([f"{name}_after" for name in columns], "^-", BLUE, "revised model"),
        )
        for names, kind, color, label in lines if loop.after.effects else lines[:2]:
            xy = path.select(names).to_numpy()
            axes.plot(xy[:, 1], xy[:, 0], kind, color=color, ms=3, lw=1.2, label=label)
            axes.plot(*xy[-1, ::-1], "*", color=color, ms=9)
        axes.plot(0, 0, "^", color=GREY, ms=6, clip_on=False)
        axes.set_title(f"cast {trial}", size=12)
        board_axes(axes)
        axes.label_outer()
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    return figure
