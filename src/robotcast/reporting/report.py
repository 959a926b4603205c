"""Gathers tables, figures and page from results, and writes them for people.

What the page says in sentences stands in report.html.
"""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robotcast.files import write_text
from robotcast.reporting.figures import (
    board_errors_figure,
    errors_figure,
    overlay_figure,
    targets_figure,
    trace_figure,
)
from robotcast.reporting.loop import Loop, loop_block
from robotcast.reporting.names import (
    cable_name,
    policy_label,
    rig_name,
    rig_names,
    thousands,
)
from robotcast.reporting.page import render
from robotcast.reporting.results import CableData, Evaluation, Results, Tuning
from robotcast.reporting.revisions_page import comparable
from robotcast.reporting.style import style, svg
from robotcast.reporting.table import Table
from robotcast.reporting.tables import cables_table, parts_table, policies_table, tuning_table

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
    run : (what, text) pairs of what was run.
    """

    results: Results
    facts: RunFacts
    loop: Loop | None
    tables: dict[str, Table]
    figures: dict[str, list[PageFigure]]
    run: list[tuple[str, str]]

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
            run=self.run,
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
            "tuning": _tuning_figures(results),
            "revisions": _revision_figures(results),
            "policies": _policy_figures(results),
            "cables": _cable_figures(results),
            "parts": _part_figures(results),
        }
    return Report(results, facts, loop, {t.name: t for t in tables}, figures, _run(results, facts))


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


def _tuning_figures(results: Results) -> list[PageFigure]:
    figures = []
    for cable in results.cables:
        tuning = results.best_tuning(cable.name)
        paths = tuning.test_paths if tuning else None
        if tuning is None or paths is None or not cable.measured:
            continue
        figures.append(
            PageFigure(
                f"overlay_{tuning.cable}_{tuning.slug}",
                f"{cable_name(tuning.cable)}, {tuning.method}: measured and simulated paths",
                "The tuned simulator that does best on this cable. Five held-out casts from the "
                "best to the worst by average waypoint error, seen from above; grey lines join "
                "waypoints of the same time, 100 ms apart. "
                f"Measured on the {rig_name(tuning.facts.get('rig', ''))}.",
                svg(overlay_figure(tuning, paths, cable.measured.cable.length_m)),
            )
        )
    traced = [t for t in results.tunings if t.trace is not None]
    if traced:
        floors = {c.name: c.floor.waypoint_percent for c in results.cables if c.floor}
        figures.append(
            PageFigure(
                "tuning_trace",
                "How tuning went",
                "The best error found so far against the casts simulated for it, on the casts "
                "that each simulator is tuned to; dotted, the noise floor that repeats of one "
                "action show.",
                svg(trace_figure(traced, floors)),
            )
        )
    return figures


def _revision_figures(results: Results) -> list[PageFigure]:
    """Draw one ladder a cable to which effects were added."""
    figures = []
    for cable in results.cables:
        tried = [r for r in comparable(cable.revisions) if any(one.effects for one in r.revisions)]
        for number, rungs in enumerate(tried, start=1):
            one = rungs.revisions[0]
            figures.append(
                PageFigure(
                    f"revisions_{cable.name}" + (f"_{number}" if number > 1 else ""),
                    f"{cable_name(cable.name)}: the error of every revision of the model",
                    f"Bars: average waypoint error on {one.heldout_casts} held-out casts after "
                    f"tuning on {one.tuning_casts} others, ± one standard error, and how far it "
                    "fell from the base model; diamonds, what the diagnosis predicted; green, the "
                    f"noise floor. Measured on the {rig_name(one.rig)}.",
                    svg(rungs.figure()),
                )
            )
    return figures


def _policy_figures(results: Results) -> list[PageFigure]:
    ordered = _in_order(e for e in results.evaluations if len(e.casts))
    if not ordered:
        return []
    floors = {c.name: c.floor.final_percent for c in results.cables if c.floor}
    errors = PageFigure(
        "errors",
        "Errors of every cast",
        "One point a cast; line and number the median, bar the quartiles; dashed, the "
        f"noise floor of the rest position. {rig_names(results.rigs).capitalize()}.",
        svg(errors_figure(ordered, floors)),
    )
    figures = [errors]
    executed = [e for e in ordered if e.kind == "executed"]
    for cable in dict.fromkeys(e.cable for e in executed):
        several = [e for e in executed if e.cable == cable]
        if len(several) > 1:
            figures.append(_targets(results, several, f"targets_{cable}", cable_name(cable)))
    return figures


def _cable_figures(results: Results) -> list[PageFigure]:
    mixed = [e for e in _executed(results) if (e.policy, e.dataset) == ("nn", "mixed")]
    return [_targets(results, mixed, "targets", "π_R2S2R on every cable")] if mixed else []


def _part_figures(results: Results) -> list[PageFigure]:
    cast = _executed(results)
    if not cast:
        return []
    caption = (
        "One disc a target; its colour and number are the median error of the casts at it, in % "
        f"of cable length. {rig_names(results.rigs).capitalize()}."
    )
    drawn = svg(board_errors_figure(_in_order(cast)))
    return [PageFigure("board_errors", "Where on the board policies miss", caption, drawn)]


def _executed(results: Results) -> list[Evaluation]:
    return [e for e in results.evaluations if e.kind == "executed" and len(e.casts)]


def _in_order(evaluations: Iterable[Evaluation]) -> list[Evaluation]:
    """Sort evaluations by cable, policy and what was learned from."""
    return sorted(evaluations, key=lambda e: (e.cable, e.policy, _DATASETS.get(e.dataset, 9)))


def _targets(
    results: Results, evaluations: Sequence[Evaluation], name: str, title: str
) -> PageFigure:
    """Draw targets, and where casts at them came to rest, over the reachable area."""
    rigs = rig_names(tuple(sorted({e.rig for e in evaluations})))
    return PageFigure(
        name,
        f"{title}: targets and endpoints",
        f"Stars are targets, dots of the same colour where the free end came to rest on the "
        f"{rigs}; dashed lines lead from the mean endpoint to the target. Grey, where tuned "
        "simulation brings the free end to rest; yellow, the sector swept by the robot’s hand.",
        svg(targets_figure(evaluations, [results.cable(e.cable) for e in evaluations])),
    )


def glance(results: Results) -> list[dict[str, str]]:
    """Return a row a cable: lengths, counts, the floor, and how near model and policy come."""
    return [_glance(results, cable) for cable in results.cables]


def _glance(results: Results, cable: CableData) -> dict[str, str]:
    measured, floor = cable.measured, cable.floor
    best = results.best_tuning(cable.name)
    mixed = results.evaluation(cable.name, "nn", "mixed")
    policy = results.best_policy(cable.name)
    label = f"{policy_label(policy.policy, policy.dataset)} " if policy else ""
    return {
        "Cable": cable_name(cable.name),
        "Length": f"{measured.cable.length_m:.2f} m" if measured else "–",
        "Casts tracked": str(len(measured.trials)) if measured else "–",
        "Lost in tracking": str(len(cable.tracking["lost"])) if "lost" in cable.tracking else "–",
        "Noise floor: waypoint / last": _pair(floor.waypoint_percent, floor.final_percent)
        if floor
        else "–",
        "Best tuned: waypoint / last": _pair(
            best.error("test", "waypoint_percent"), best.error("test", "final_percent")
        )
        if best
        else "–",
        "D_sim casts": thousands(len(cable.simulated)) if cable.simulated else "–",
        "Diverged": str(cable.generation.get("diverged", "–")),
        "π_R2S2R median": _percent(mixed.median_percent if mixed else None),
        "Best policy median": label + _percent(policy.median_percent if policy else None),
        "Its repeats scatter": _percent(policy.scatter_percent if policy else None),
    }


def _pair(first: float | None, second: float | None) -> str:
    return f"{_percent(first)} / {_percent(second)}"


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{value:.1f}%"


def _run(results: Results, facts: RunFacts) -> list[tuple[str, str]]:
    """Return what a run was as rows (what, text)."""
    rows = [
        ("Rig", rig_names(results.rigs)),
        ("Scale", facts.scale),
        ("Seed", str(facts.seed)),
        *facts.sizes,
    ]
    for cable in results.cables:
        if cable.measured is not None:
            trials, lost = cable.measured.trials, len(cable.tracking.get("lost", ()))
            actions = len({trial.action_id for trial in trials})
            more = f"; {thousands(lost)} more lost in tracking" if lost else ""
            text = f"{thousands(len(trials))} casts of {thousands(actions)} actions{more}"
            rows.append((f"Measured, {cable_name(cable.name)}", text))
    rows += [(f"Tuned, {cable_name(t.cable)}", _tuned(t)) for t in results.tunings]
    for (cable, folder), policy in results.policies.items():
        name = policy_label(*folder.rsplit("-", 1))
        given = {k: v for k, v in policy["examples"].items() if k not in ("cable", "mixtures")}
        examples = ", ".join(f"{k.replace('_', ' ')} {v}" for k, v in given.items())
        rows.append(
            (
                f"Trained, {cable_name(cable)}",
                f"{name}: {examples}; best after {policy['best_epoch']} of {policy['epochs']} "
                f"passes, median error on validation {1000 * policy['validation_median_m']:.0f} mm",
            )
        )
    return rows


def _tuned(tuning: Tuning) -> str:
    """Return what a tuning was, and what to know before trusting its parameters."""
    facts = tuning.facts
    bounds = [name for name, p in facts.get("parameters", {}).items() if p.get("at_bound")]
    vague, lost = facts.get("certainty", {}).get("vague"), facts.get("diverged_casts")
    doubts = [
        f"{thousands(lost)} diverged" if lost else "",
        f"at a bound: {', '.join(bounds)}" if bounds else "",
        f"hardly told by the casts: {', '.join(vague)}" if vague else "",
        "" if "certainty" in facts else "too few casts to say how well these tell the parameters",
    ]
    casts = f"{tuning.method}: {thousands(facts.get('simulated_casts', 0))} simulated casts"
    return "; ".join([f"{casts}, seed {facts.get('seed', '–')}", *filter(None, doubts)])
