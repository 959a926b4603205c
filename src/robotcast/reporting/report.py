"""Gathers tables, figures and page from results, and writes them for people.

Its sentences stand in report.html, and those of the loop in loop.html: where the tuned
model of one cable fails, what it lacks, and what adding that is worth.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import polars as pl
from markupsafe import Markup
from matplotlib.figure import Figure

from robotcast.files import write_text
from robotcast.reporting import names, style
from robotcast.reporting.figures import (
    errors_figure,
    overlay_figure,
    targets_figure,
    trace_figure,
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
from robotcast.reporting.tables import (
    MISSING,
    cables_table,
    parts_table,
    percent,
    policies_table,
    tuning_table,
)

SHOWN = 3  # casts whose paths are drawn


@dataclass(frozen=True)
class Loop:
    """What the loop's stages wrote."""

    before: Tuning
    after: Tuning  # revised as the diagnosis says
    comparison: Mapping[str, Any]
    diagnosis: Mapping[str, Any]
    policies: tuple[Evaluation, Evaluation] | None  # that learned from each of the two, if tested
    hidden: Mapping[str, Mapping[str, float]] | None  # mechanism → its parameters; of a virtual rig
    actions: Mapping[int, int]  # trial → action, of the cable's casts

    @property
    def falls(self) -> tuple[float, float]:
        """Average waypoint error on held-out casts before and after, in % of cable length."""
        models = (self.before, self.after)
        before, after = (t.facts["errors"]["test"]["waypoint_percent"] for t in models)
        return before, after


def read_loop(folder: Path, results: Results, hidden: Mapping[str, Any] | None) -> Loop | None:
    """Read data/loop, None where its stages have not run; `hidden` is the rig's opened answer."""
    tuned = folder / "tuned" / "tuned.yaml"
    if not tuned.is_file():
        return None
    after = read_tuning(tuned)
    pair = (after.cable, after.simulator, after.optimizer)
    before = next(t for t in results.tunings if (t.cable, t.simulator, t.optimizer) == pair)
    evaluation, policies = folder / "evaluation" / "evaluation.csv", None
    if evaluation.is_file():
        revised = read_evaluation(evaluation)
        first = results.evaluation(revised.cable, revised.policy, revised.dataset)
        policies = (first, revised) if first else None
    cable = results.cable(after.cable)
    assert cable is not None and cable.measured is not None
    comparison, diagnosis = (
        json.loads((folder / name / f"{name}.json").read_text(encoding="utf-8"))
        for name in ("comparison", "diagnosis")
    )
    found = {e["effect"]: e["parameters"] for e in hidden["effects"]} if hidden else None
    actions = {trial.trial: trial.action_id for trial in cable.measured.trials}
    return Loop(before, after, comparison, diagnosis, policies, found, actions)


def loop_block(loop: Loop) -> Markup:
    """Return the loop as the first part of the report's page."""
    verdict = [v for v in loop.diagnosis["verdict"] if v not in ("none", "unknown")]
    floor = loop.diagnosis["noise_floor_percent"]
    axis = "average error on held-out casts [% of cable length]"
    return block(
        "loop.html",
        "loop",
        cable=names.cable_name(loop.before.cable),
        before=loop.falls[0],
        after=loop.falls[1],
        floor=floor,
        findings=[s["sentence"] for s in loop.comparison["slices"]][:2],
        diagnosis=loop.diagnosis,
        verdict=verdict,
        sizes=[row for name in verdict for row in _sizes(loop, name)],
        paths=style.inline(_paths(loop), "Measured paths, and those of both models"),
        ladder=style.inline(style.bars(_ladder(loop), axis, floor), "Error before and after"),
        targets=loop.policies[0].targets if loop.policies else 0,
        medians=[(e.median_percent, e.median_interval) for e in loop.policies or ()],
        hidden=loop.hidden,
        right=loop.hidden is not None and set(loop.hidden) == set(verdict),
    )


def _ladder(loop: Loop) -> list[style.Row]:
    before, after = loop.falls
    rows = [style.Row("tuned model", (style.Bar(before, "before"),))]
    if loop.after.effects:
        added = " + ".join(names.effect_name(e) for e in loop.after.effects)
        rows.append(style.Row(f"+ {added}", (style.Bar(after, note=style.fall(before, after)),)))
    return rows


def _sizes(loop: Loop, effect: str) -> list[tuple[str, str, str]]:
    """Return (name, found with interval, hidden) of an effect's parameters."""
    rows = []
    for name, given in loop.diagnosis["model"]["parameters"].items():
        owner, _, parameter = name.partition(".")
        if owner != effect:
            continue
        value, low, high = names.with_interval(given["value"], given["low"], given["high"])
        unit = given["unit"] or ""
        true = (loop.hidden or {}).get(effect, {}).get(parameter)
        hidden = "–" if true is None else names.with_unit(names.number(true), unit)
        words = f"{names.effect_name(effect)}, {parameter}"
        rows.append((words, f"{names.with_unit(value, unit)}, between {low} and {high}", hidden))
    return rows


@style.style(on_page=True)
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
            (("x", "y"), "o-", style.BLACK, "measured"),
            (columns, "s--", style.VERMILION, "tuned model"),
            ([f"{name}_after" for name in columns], "^-", style.BLUE, "revised model"),
        )
        for of, kind, color, label in lines if loop.after.effects else lines[:2]:
            xy = path.select(of).to_numpy()
            axes.plot(xy[:, 1], xy[:, 0], kind, color=color, ms=3, lw=1.2, label=label)
            axes.plot(*xy[-1, ::-1], "*", color=color, ms=9)
        axes.plot(0, 0, "^", color=style.GREY, ms=6, clip_on=False)
        axes.set_title(f"cast {trial}", size=12)
        style.board_axes(axes)
        axes.label_outer()
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    return figure


_DATASETS = {"real": 0, "simulated": 1, "mixed": 2}


@dataclass(frozen=True)
class RunFacts:
    """What results do not tell of their run; `sizes` are (name, text) pairs of its scale."""

    scale: str
    seed: int
    sizes: tuple[tuple[str, str], ...]


class PageFigure(NamedTuple):
    """A figure as the page shows it and as it lies in figures/."""

    name: str
    title: str
    caption: str
    svg: str


def write_report(
    results: Results, facts: RunFacts, folder: Path, loop: Loop | None = None
) -> list[Path]:
    """Write tables/, figures/, metrics and index.html into `folder`; return what was written.

    The page is one HTML file that needs nothing else.
    """
    makers = (tuning_table, policies_table, cables_table, parts_table)
    tables = {table.name: table for table in (make(results) for make in makers)}
    with style.style():
        figures = _figures(results)
    texts: dict[str, str] = {}
    for name, table in tables.items():
        texts[f"tables/{name}.md"] = table.markdown()
        texts[f"tables/{name}.tex"] = table.latex()
        texts[f"tables/{name}.csv"] = table.csv()
    for of in figures.values():
        texts |= {f"figures/{f.name}.svg": f.svg for f in of}
    texts["metrics.json"] = json.dumps(metrics(results, loop), indent=1)
    texts["index.html"] = render(
        "report.html",
        cables=", ".join(names.cable_name(c.name) for c in results.cables),
        rig_names=names.rig_names(results.rigs),
        policies={e.policy for e in results.evaluations if len(e.casts)},
        predicted=any(e.kind == "predicted" for e in results.evaluations),
        loop=loop_block(loop) if loop else "",
        glance=[glance(results, cable) for cable in results.cables],
        tables=tables,
        figures=figures,
        facts=facts,
        results=results,
    )
    for name, text in texts.items():
        write_text(folder / name, text)
    return [folder / name for name in texts]


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


def _figures(results: Results) -> dict[str, list[PageFigure]]:
    """Return section of the page → its figures."""
    figures = {name: [] for name in ("tuning", "revisions", "policies", "cables", "parts")}

    def add(section: str, name: str, title: str, figure: Figure, told: str) -> None:
        figures[section].append(PageFigure(name, title, told, style.svg(figure)))

    def add_targets(section: str, name: str, title: str, some: Sequence[Evaluation]) -> None:
        figure = targets_figure(some, [results.cable(e.cable) for e in some])
        add(section, name, f"{title}: targets and endpoints", figure, caption("targets", some))

    for cable in results.cables:
        tuning = results.best_tuning(cable.name)
        paths = tuning.test_paths if tuning else None
        if tuning is not None and paths is not None and cable.measured:
            name, told = f"overlay_{tuning.cable}_{tuning.slug}", tuning.facts.get("rig", "")
            title = (
                f"{names.cable_name(tuning.cable)}, {tuning.method}: measured and simulated paths"
            )
            figure = overlay_figure(tuning, paths, cable.measured.cable.length_m)
            add("tuning", name, title, figure, caption("overlay", told))
    if traced := [t for t in results.tunings if t.trace is not None]:
        floors = {c.name: c.floor.waypoint_percent for c in results.cables if c.floor}
        figure = trace_figure(traced, floors)
        add("tuning", "tuning_trace", "How tuning went", figure, caption("tuning_trace"))
    for cable in results.cables:  # one ladder a cable to which effects were added
        tried = [r for r in comparable(cable.revisions) if any(one.effects for one in r.revisions)]
        title = f"{names.cable_name(cable.name)}: the error of every revision of the model"
        for nth, of in enumerate(tried, start=1):
            name = f"revisions_{cable.name}" + (f"_{nth}" if nth > 1 else "")
            add("revisions", name, title, of.figure(), caption("revisions", of.revisions[0]))

    def place(e: Evaluation) -> tuple:
        return e.cable, e.policy, _DATASETS.get(e.dataset, 9)

    shown = sorted((e for e in results.evaluations if len(e.casts)), key=place)
    cast = [e for e in shown if e.kind == "executed"]
    if shown:
        floors = {c.name: c.floor.final_percent for c in results.cables if c.floor}
        figure, told = errors_figure(shown, floors), caption("errors", results.rigs)
        add("policies", "errors", "Errors of every cast", figure, told)
    for cable in dict.fromkeys(e.cable for e in cast):
        several = [e for e in cast if e.cable == cable]
        if len(several) > 1:
            add_targets("policies", f"targets_{cable}", names.cable_name(cable), several)
    if mixed := [e for e in cast if (e.policy, e.dataset) == ("nn", "mixed")]:
        add_targets("cables", "targets", "π_R2S2R on every cable", mixed)
    return figures


def glance(results: Results, cable: CableData) -> dict[str, str]:
    """Return a cable's row: lengths, counts, the floor, and how near model and policy come."""
    measured, floor, lost = cable.measured, cable.floor, cable.tracking.get("lost")
    best, policy = results.best_tuning(cable.name), results.best_policy(cable.name)
    mixed = results.evaluation(cable.name, "nn", "mixed")
    label = f"{names.policy_label(policy.policy, policy.dataset)} " if policy else ""
    errors = (
        [best.error("test", of) for of in ("waypoint_percent", "final_percent")] if best else ()
    )
    floors = [floor.waypoint_percent, floor.final_percent] if floor else ()
    return {
        "Cable": names.cable_name(cable.name),
        "Length": f"{measured.cable.length_m:.2f} m" if measured else MISSING,
        "Casts tracked": str(len(measured.trials)) if measured else MISSING,
        "Lost in tracking": str(len(lost)) if lost is not None else MISSING,
        "Noise floor: waypoint / last": " / ".join(map(percent, floors)) or MISSING,
        "Best tuned: waypoint / last": " / ".join(map(percent, errors)) or MISSING,
        "D_sim casts": names.thousands(len(cable.simulated)) if cable.simulated else MISSING,
        "Diverged": str(cable.generation.get("diverged", MISSING)),
        "π_R2S2R median": percent(mixed.median_percent if mixed else None),
        "Best policy median": label + percent(policy.median_percent if policy else None),
        "Its repeats scatter": percent(policy.scatter_percent if policy else None),
    }
