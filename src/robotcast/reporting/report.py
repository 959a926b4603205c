"""Gathers tables, figures and page from results, and writes them for people.

Its sentences stand in report.html, and those of the loop in loop.html: where the tuned
model of one cable fails, what it lacks, and what adding that is worth.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl
from markupsafe import Markup
from matplotlib.figure import Figure

from robotcast.files import write_text
from robotcast.reporting.figures import (
    errors_figure,
    overlay_figure,
    targets_figure,
    trace_figure,
)
from robotcast.reporting.names import (
    cable_name,
    effect_name,
    number,
    policy_label,
    rig_names,
    thousands,
    with_interval,
    with_unit,
)
from robotcast.reporting.page import block, caption, render
from robotcast.reporting.results import (
    CableData,
    Evaluation,
    Results,
    Tuning,
    read_evaluation,
    read_tuning,
)
from robotcast.reporting.revisions_page import comparable
from robotcast.reporting.style import (
    BLACK,
    BLUE,
    GREY,
    VERMILION,
    Bar,
    Row,
    bars,
    board_axes,
    fall,
    inline,
    style,
    svg,
)
from robotcast.reporting.tables import (
    MISSING,
    Table,
    cables_table,
    parts_table,
    percent,
    policies_table,
    tuning_table,
)

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


_DATASETS = {"real": 0, "simulated": 1, "mixed": 2}


@dataclass(frozen=True)
class RunFacts:
    """What the caller knows of the run that the results do not tell.

    Attributes
    ----------
    sizes : (name, text) pairs of the scale's sizes.
    """

    scale: str
    seed: int
    sizes: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class PageFigure:
    """A figure as the page shows it and as it lies in figures/."""

    name: str
    title: str
    caption: str
    svg: bytes


@dataclass(frozen=True)
class Report:
    """All that is written for people.

    Attributes
    ----------
    tables : by name.
    figures : section of the page → its figures.
    """

    results: Results
    facts: RunFacts
    loop: Loop | None
    tables: dict[str, Table]
    figures: dict[str, list[PageFigure]]

    def html(self) -> str:
        """Return the page, one HTML file that needs nothing else."""
        return render(
            "report.html",
            cables=", ".join(cable_name(c.name) for c in self.results.cables),
            rigs=self.results.rigs,
            rig_names=rig_names(self.results.rigs),
            scale=self.facts.scale,
            policies={e.policy for e in self.results.evaluations if len(e.casts)},
            predicted=any(e.kind == "predicted" for e in self.results.evaluations),
            loop=loop_block(self.loop) if self.loop else "",
            glance=glance(self.results),
            tables=self.tables,
            figures=self.figures,
            facts=self.facts,
            results=self.results,
        )


def write_report(
    results: Results, facts: RunFacts, folder: Path, loop: Loop | None = None
) -> list[Path]:
    """Write tables/, figures/, metrics and index.html into `folder`; return what was written."""
    report = make_report(results, facts, loop)
    texts: dict[str, str] = {}
    for name, table in report.tables.items():
        texts[f"tables/{name}.md"] = table.markdown()
        texts[f"tables/{name}.tex"] = table.latex()
        texts[f"tables/{name}.csv"] = table.csv()
    for figures in report.figures.values():
        texts |= {f"figures/{f.name}.svg": f.svg.decode("utf-8") for f in figures}
    texts["metrics.json"] = json.dumps(metrics(results, loop), indent=1)
    texts["index.html"] = report.html()
    for name, text in texts.items():
        write_text(folder / name, text)
    return [folder / name for name in texts]


def make_report(results: Results, facts: RunFacts, loop: Loop | None = None) -> Report:
    """Make tables, figures and page of `results`."""
    tables = [make(results) for make in (tuning_table, policies_table, cables_table, parts_table)]
    with style():
        figures = {
            "tuning": [*_overlays(results), *_traces(results)],
            "revisions": list(_ladders(results)),
            **_policy_figures(results),
        }
    return Report(results, facts, loop, {t.name: t for t in tables}, figures)


def metrics(results: Results, loop: Loop | None) -> dict[str, Any]:
    """Return the errors that `dvc metrics` compares, in % of cable length."""
    tuned: dict[str, Any] = {}
    for t in results.tunings:
        tuned.setdefault(t.cable, {})[t.slug] = t.error("test", "waypoint_percent")
    policies: dict[str, Any] = {}
    for e in results.evaluations:
        policies.setdefault(e.cable, {})[f"{e.policy}-{e.dataset}"] = e.median_percent
    fall = dict(zip(("tuned", "revised"), loop.falls, strict=True)) if loop else {}
    return {"heldout_waypoint_error": tuned, "policy_median_error": policies, "loop": fall}


def _overlays(results: Results) -> Iterator[PageFigure]:
    for cable in results.cables:
        tuning = results.best_tuning(cable.name)
        paths = tuning.test_paths if tuning else None
        if tuning is not None and paths is not None and cable.measured:
            yield PageFigure(
                f"overlay_{tuning.cable}_{tuning.slug}",
                f"{cable_name(tuning.cable)}, {tuning.method}: measured and simulated paths",
                caption("overlay", tuning.facts.get("rig", "")),
                svg(overlay_figure(tuning, paths, cable.measured.cable.length_m)),
            )


def _traces(results: Results) -> Iterator[PageFigure]:
    traced = [t for t in results.tunings if t.trace is not None]
    if traced:
        floors = {c.name: c.floor.waypoint_percent for c in results.cables if c.floor}
        told, drawn = caption("tuning_trace"), svg(trace_figure(traced, floors))
        yield PageFigure("tuning_trace", "How tuning went", told, drawn)


def _ladders(results: Results) -> Iterator[PageFigure]:
    """Draw one ladder a cable to which effects were added."""
    for cable in results.cables:
        tried = [r for r in comparable(cable.revisions) if any(one.effects for one in r.revisions)]
        title = f"{cable_name(cable.name)}: the error of every revision of the model"
        for nth, of in enumerate(tried, start=1):
            name = f"revisions_{cable.name}" + (f"_{nth}" if nth > 1 else "")
            told = caption("revisions", of.revisions[0])
            yield PageFigure(name, title, told, svg(of.figure()))


def _policy_figures(results: Results) -> dict[str, list[PageFigure]]:
    def targets(name: str, title: str, some: Sequence[Evaluation]) -> PageFigure:
        cables = [results.cable(e.cable) for e in some]
        told, drawn = caption("targets", some), svg(targets_figure(some, cables))
        return PageFigure(name, f"{title}: targets and endpoints", told, drawn)

    def place(e: Evaluation) -> tuple:
        return e.cable, e.policy, _DATASETS.get(e.dataset, 9)

    shown = sorted((e for e in results.evaluations if len(e.casts)), key=place)
    cast = [e for e in shown if e.kind == "executed"]
    mixed = [e for e in cast if (e.policy, e.dataset) == ("nn", "mixed")]
    figures: dict[str, list[PageFigure]] = {"policies": [], "cables": [], "parts": []}
    if shown:
        floors = {c.name: c.floor.final_percent for c in results.cables if c.floor}
        told, drawn = caption("errors", results.rigs), svg(errors_figure(shown, floors))
        figures["policies"].append(PageFigure("errors", "Errors of every cast", told, drawn))
    for cable in dict.fromkeys(e.cable for e in cast):
        several = [e for e in cast if e.cable == cable]
        if len(several) > 1:
            figures["policies"].append(targets(f"targets_{cable}", cable_name(cable), several))
    if mixed:
        figures["cables"].append(targets("targets", "π_R2S2R on every cable", mixed))
    return figures


def glance(results: Results) -> list[dict[str, str]]:
    """Return a row a cable: lengths, counts, the floor, and how near model and policy come."""
    return [_glance(results, cable) for cable in results.cables]


def _glance(results: Results, cable: CableData) -> dict[str, str]:
    measured, floor = cable.measured, cable.floor
    best, policy = results.best_tuning(cable.name), results.best_policy(cable.name)
    mixed = results.evaluation(cable.name, "nn", "mixed")
    label = f"{policy_label(policy.policy, policy.dataset)} " if policy else ""
    errors = (
        [best.error("test", of) for of in ("waypoint_percent", "final_percent")] if best else ()
    )
    floors = [floor.waypoint_percent, floor.final_percent] if floor else ()
    return {
        "Cable": cable_name(cable.name),
        "Length": f"{measured.cable.length_m:.2f} m" if measured else MISSING,
        "Casts tracked": str(len(measured.trials)) if measured else MISSING,
        "Lost in tracking": str(len(cable.tracking["lost"]))
        if "lost" in cable.tracking
        else MISSING,
        "Noise floor: waypoint / last": " / ".join(map(percent, floors)) or MISSING,
        "Best tuned: waypoint / last": " / ".join(map(percent, errors)) or MISSING,
        "D_sim casts": thousands(len(cable.simulated)) if cable.simulated else MISSING,
        "Diverged": str(cable.generation.get("diverged", MISSING)),
        "π_R2S2R median": percent(mixed.median_percent if mixed else None),
        "Best policy median": label + percent(policy.median_percent if policy else None),
        "Its repeats scatter": percent(policy.scatter_percent if policy else None),
    }
