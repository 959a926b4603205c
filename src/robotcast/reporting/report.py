"""Gathers tables, figures and page from results, and writes them for people.

What the page says in sentences stands in report.html.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from robotcast.files import write_text
from robotcast.reporting.figures import (
    board_errors_figure,
    errors_figure,
    overlay_figure,
    targets_figure,
    trace_figure,
)
from robotcast.reporting.names import (
    cable_name,
    policy_label,
    rig_name,
    rig_names,
    thousands,
)
from robotcast.reporting.page import caption, render
from robotcast.reporting.results import CableData, Evaluation, Results
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
    """

    results: Results
    facts: RunFacts
    tables: dict[str, Table]
    figures: dict[str, list[PageFigure]]

    def html(self) -> str:
        """Return the page, one HTML file that needs nothing else."""
        return render(
            "report.html",
            cables=", ".join(cable_name(c.name) for c in self.results.cables),
            rigs=self.results.rigs,
            rigs_named=rig_names(self.results.rigs),
            scale=self.facts.scale,
            policies={e.policy for e in self.results.evaluations if len(e.casts)},
            predicted=any(e.kind == "predicted" for e in self.results.evaluations),
            glance=glance(self.results),
            tables=self.tables,
            figures=self.figures,
            facts=self.facts,
            results=self.results,
        )


def write_report(results: Results, facts: RunFacts, folder: Path) -> list[Path]:
    """Write tables/, figures/ and index.html into `folder`; return what was written."""
    report = make_report(results, facts)
    texts: dict[str, str] = {}
    for name, table in report.tables.items():
        texts[f"tables/{name}.md"] = table.markdown()
        texts[f"tables/{name}.tex"] = table.latex()
        texts[f"tables/{name}.csv"] = table.csv()
    for figures in report.figures.values():
        texts |= {f"figures/{f.name}.svg": f.svg.decode("utf-8") for f in figures}
    texts["index.html"] = report.html()
    for name, text in texts.items():
        write_text(folder / name, text)
    return [folder / name for name in texts]


def make_report(results: Results, facts: RunFacts) -> Report:
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
    return Report(results, facts, {t.name: t for t in tables}, figures)


def _tuning_figures(results: Results) -> list[PageFigure]:
    figures = []
    for cable in results.cables:
        tuning = results.best_tuning(cable.name)
        paths = tuning.test_paths if tuning else None
        if tuning is not None and paths is not None and cable.measured:
            name = f"overlay_{tuning.cable}_{tuning.slug}"
            title = f"{cable_name(tuning.cable)}, {tuning.method}: measured and simulated paths"
            told = caption("overlay", rig_name(tuning.facts.get("rig", "")))
            drawn = svg(overlay_figure(tuning, paths, cable.measured.cable.length_m))
            figures.append(PageFigure(name, title, told, drawn))
    traced = [t for t in results.tunings if t.trace is not None]
    if traced:
        floors = {c.name: c.floor.waypoint_percent for c in results.cables if c.floor}
        told, drawn = caption("tuning_trace"), svg(trace_figure(traced, floors))
        figures.append(PageFigure("tuning_trace", "How tuning went", told, drawn))
    return figures


def _revision_figures(results: Results) -> list[PageFigure]:
    """Draw one ladder a cable to which effects were added."""
    figures = []
    for cable in results.cables:
        tried = [r for r in comparable(cable.revisions) if any(one.effects for one in r.revisions)]
        title = f"{cable_name(cable.name)}: the error of every revision of the model"
        for number, of in enumerate(tried, start=1):
            name = f"revisions_{cable.name}" + (f"_{number}" if number > 1 else "")
            told, drawn = caption("revisions", of.revisions[0]), svg(of.figure())
            figures.append(PageFigure(name, title, told, drawn))
    return figures


def _policy_figures(results: Results) -> list[PageFigure]:
    ordered = _in_order(e for e in results.evaluations if len(e.casts))
    if not ordered:
        return []
    floors = {c.name: c.floor.final_percent for c in results.cables if c.floor}
    told, drawn = caption("errors", rig_names(results.rigs)), svg(errors_figure(ordered, floors))
    figures = [PageFigure("errors", "Errors of every cast", told, drawn)]
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
    cast = _in_order(_executed(results))
    if not cast:
        return []
    told, drawn = caption("board_errors", rig_names(results.rigs)), svg(board_errors_figure(cast))
    return [PageFigure("board_errors", "Where on the board policies miss", told, drawn)]


def _executed(results: Results) -> list[Evaluation]:
    return [e for e in results.evaluations if e.kind == "executed" and len(e.casts)]


def _in_order(evaluations: Iterable[Evaluation]) -> list[Evaluation]:
    """Sort evaluations by cable, policy and what was learned from."""
    return sorted(evaluations, key=lambda e: (e.cable, e.policy, _DATASETS.get(e.dataset, 9)))


def _targets(
    results: Results, evaluations: Sequence[Evaluation], name: str, title: str
) -> PageFigure:
    """Draw targets, and where casts at them came to rest, over the reachable area."""
    cables = [results.cable(e.cable) for e in evaluations]
    told, drawn = caption("targets", evaluations), svg(targets_figure(evaluations, cables))
    return PageFigure(name, f"{title}: targets and endpoints", told, drawn)


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
