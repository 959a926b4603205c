"""Gathers tables, figures and page from results, and writes them for people."""

from dataclasses import dataclass
from pathlib import Path

from robotcast.files import write_text
from robotcast.reporting.figures.board_errors import board_errors_figure
from robotcast.reporting.figures.errors import errors_figure
from robotcast.reporting.figures.overlay import overlay_figure
from robotcast.reporting.figures.style import style, svg
from robotcast.reporting.figures.targets import targets_figure
from robotcast.reporting.figures.trace import trace_figure
from robotcast.reporting.names import (
    cable_name,
    optimizer_name,
    policy_label,
    rig_name,
    rig_names,
    simulator_name,
    thousands,
)
from robotcast.reporting.page import Glance, Page, PageFigure, Section
from robotcast.reporting.results import CableData, Evaluation, Results, Tuning
from robotcast.reporting.revisions.rungs import comparable
from robotcast.reporting.tables import (
    all_tables,
    cables_table,
    parts_table,
    policies_table,
    tuning_table,
)

_ORDER = {"real": 0, "simulated": 1, "mixed": 2}

VIRTUAL_WARNING = (
    "The virtual rig is not a robot. It is a finer simulation of another make, with camera "
    "pictures drawn from it; it stands in for the robot so that the whole pipeline can run "
    "anywhere. Its numbers show that the pipeline works, not how a real cable behaves."
)

RECORDED_WARNING = (
    "Nothing was executed for these policies: the casts are recorded ones, so a policy is judged "
    "by how far its forward model’s endpoint lies from the measured endpoint of held-out casts."
)


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


def write_report(results: Results, facts: RunFacts, folder: Path) -> list[Path]:
    """Write tables/, figures/ and index.html into `folder`; return what was written."""
    written = []
    for table in all_tables(results):
        for suffix, text in (
            ("md", table.markdown()),
            ("tex", table.latex()),
            ("csv", table.csv()),
        ):
            path = folder / "tables" / f"{table.name}.{suffix}"
            write_text(path, text)
            written.append(path)
    page = make_page(results, facts)
    for section in page.sections:
        for figure in section.figures:
            path = folder / "figures" / f"{figure.name}.svg"
            write_text(path, figure.svg.decode("utf-8"))
            written.append(path)
    write_text(folder / "index.html", page.html())
    return [*written, folder / "index.html"]


def make_page(results: Results, facts: RunFacts) -> Page:
    """Make the page of `results`."""
    warnings = []
    if "virtual" in results.rigs:
        warnings.append(VIRTUAL_WARNING)
    if any(e.kind == "predicted" for e in results.evaluations):
        warnings.append(RECORDED_WARNING)
    with style():
        sections = (
            _tuning_section(results),
            *_revisions_section(results),
            _policies_section(results),
            _cables_section(results),
            *_parts_section(results),
        )
    names = ", ".join(cable_name(c.name) for c in results.cables)
    return Page(
        lead=(
            f"{names} on the {rig_names(results.rigs)}, {facts.scale} scale: casts are tracked in "
            "camera video, a simulator is tuned to them, many casts are simulated, and policies "
            "learn from both to lay the free end of the cable on a target."
        ),
        warnings=tuple(warnings),
        glance=_glance(results),
        sections=sections,
        run=_run(results, facts),
        commands=_COMMANDS,
    )


def _tuning_section(results: Results) -> Section:
    figures = []
    lengths = {c.name: c.measured.cable.length_m for c in results.cables if c.measured}
    for cable in results.cables:
        tuning = _best_tuning(results, cable.name)
        paths = tuning.test_paths if tuning else None
        if tuning is None or paths is None or tuning.cable not in lengths:
            continue
        method = f"{simulator_name(tuning.simulator)}, {optimizer_name(tuning.optimizer)}"
        figures.append(
            PageFigure(
                f"overlay_{tuning.cable}_{tuning.simulator}-{tuning.optimizer}",
                f"{cable_name(tuning.cable)}, {method}: measured and simulated paths",
                "The tuned simulator that does best on this cable. Five held-out casts from the "
                "best to the worst by average waypoint error, seen from above; grey lines join "
                "waypoints of the same time, 100 ms apart. "
                f"Measured on the {rig_name(tuning.facts.get('rig', ''))}.",
                svg(overlay_figure(tuning, paths, lengths[tuning.cable])),
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
    text = (
        "Each simulator is tuned on some measured casts and judged on others, which share no "
        "action with them."
    )
    return Section("Does the tuned simulator match?", text, tuning_table(results), tuple(figures))


def _revisions_section(results: Results) -> tuple[Section, ...]:
    """Draw one ladder a cable to which effects were added; no section where none was."""
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
                    rungs.figure().encode("utf-8"),
                )
            )
    if not figures:
        return ()
    text = (
        "A revision is the tuned model with the physical effects that were added to it. All "
        "revisions shown together were tuned to the same casts and judged on the same others, so "
        "a shorter bar is a better model. No bar should end left of the noise floor."
    )
    return (Section("Does the error fall from revision to revision?", text, None, tuple(figures)),)


def _policies_section(results: Results) -> Section:
    ordered = sorted(
        (e for e in results.evaluations if len(e.casts)),
        key=lambda e: (e.cable, e.policy, _ORDER.get(e.dataset, 9)),
    )
    figures = []
    if ordered:
        floors = {c.name: c.floor.final_percent for c in results.cables if c.floor}
        figures.append(
            PageFigure(
                "errors",
                "Errors of every cast",
                "One point a cast; line and number the median, bar the quartiles; dashed, the "
                f"noise floor of the rest position. {rig_names(results.rigs).capitalize()}.",
                svg(errors_figure(ordered, floors)),
            )
        )
    for cable in dict.fromkeys(e.cable for e in ordered):
        several = [e for e in ordered if e.cable == cable and e.kind == "executed"]
        if len(several) > 1:
            figures.append(_targets(results, several, f"targets_{cable}", cable_name(cable)))
    text = (
        "A policy looks up, among the feasible candidate actions, the one whose predicted endpoint "
        "is nearest to the target, and moves on from it along the model’s gradient. "
        "π_RD learned from measured casts, π_SD from simulated ones, "
        "π_R2S2R from both. All are tested on the same targets."
    )
    title = "Which data make the better policy?"
    return Section(title, text, policies_table(results), tuple(figures))


def _cables_section(results: Results) -> Section:
    mixed = [e for e in results.evaluations if (e.policy, e.dataset) == ("nn", "mixed")]
    mixed = [e for e in mixed if e.kind == "executed" and len(e.casts)]
    figures = (_targets(results, mixed, "targets", "π_R2S2R on every cable"),) if mixed else ()
    return Section("Does it hold for every cable?", "", cables_table(results), figures)


def _parts_section(results: Results) -> tuple[Section, ...]:
    """Say what the errors are made of and where they are; no section where nothing was cast."""
    cast = [e for e in results.evaluations if e.kind == "executed" and len(e.casts)]
    if not cast:
        return ()
    cast.sort(key=lambda e: (e.cable, e.policy, _ORDER.get(e.dataset, 9)))
    figure = PageFigure(
        "board_errors",
        "Where on the board policies miss",
        "One disc a target; its colour and number are the median error of the casts at it, in % "
        f"of cable length. {rig_names(results.rigs).capitalize()}.",
        svg(board_errors_figure(cast)),
    )
    text = (
        "Repeats of one action come to rest apart, which no policy can help; what is left is the "
        "model’s: the gap between simulation and rig, and what learning missed."
    )
    title = "How much of the error is the model’s?"
    return (Section(title, text, parts_table(results), (figure,)),)


def _targets(results: Results, evaluations: list[Evaluation], name: str, title: str) -> PageFigure:
    rigs = rig_names(tuple(sorted({e.rig for e in evaluations})))
    return PageFigure(
        name,
        f"{title}: targets and endpoints",
        f"Stars are targets, dots of the same colour where the free end came to rest on the "
        f"{rigs}; dashed lines lead from the mean endpoint to the target. Grey, where tuned "
        "simulation brings the free end to rest; yellow, the sector swept by the robot’s hand.",
        svg(targets_figure(evaluations, [results.cable(e.cable) for e in evaluations])),
    )


def _glance(results: Results) -> Glance:
    rows = tuple(_glance_row(results, cable) for cable in results.cables)
    return Glance(
        columns=(
            "Cable",
            "Length",
            "Casts tracked",
            "Lost in tracking",
            "Noise floor: waypoint / last",
            "Best tuned: waypoint / last",
            "D_sim casts",
            "Diverged",
            "π_R2S2R median",
            "Its repeats scatter",
        ),
        rows=rows,
        caption=(
            "Percentages are of cable length; “last” is the final rest position. The noise floor "
            "and the scatter are what repeats of one action show, and bound what any model or "
            "policy can reach. – was not run or is not known."
        ),
    )


def _glance_row(results: Results, cable: CableData) -> tuple[str, ...]:
    measured, floor = cable.measured, cable.floor
    best = _best_tuning(results, cable.name)
    mixed = results.evaluation(cable.name, "nn", "mixed")
    has_errors = mixed is not None and len(mixed.errors_percent) > 0
    return (
        cable_name(cable.name),
        f"{measured.cable.length_m:.2f} m" if measured else "–",
        str(len(measured.trials)) if measured else "–",
        str(len(cable.tracking["lost"])) if "lost" in cable.tracking else "–",
        _pair(floor.waypoint_percent, floor.final_percent) if floor else "–",
        _pair(_test_error(best), best.error("test", "final_percent")) if best else "–",
        thousands(len(cable.simulated)) if cable.simulated else "–",
        str(cable.generation.get("diverged", "–")),
        _percent(float(mixed.casts["error_percent"].median())) if has_errors else "–",  # type: ignore
        _percent(mixed.scatter_percent) if mixed else "–",
    )


def _best_tuning(results: Results, cable: str) -> Tuning | None:
    """Return the tuned simulator that does best on held-out casts of a cable."""
    tunings = [t for t in results.tunings if t.cable == cable and _test_error(t) is not None]
    return min(tunings, key=_test_error, default=None)  # type: ignore[arg-type]


def _test_error(tuning: Tuning) -> float | None:
    return tuning.error("test", "waypoint_percent")


def _pair(first: float | None, second: float | None) -> str:
    return f"{_percent(first)} / {_percent(second)}"


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{value:.1f}%"


def _run(results: Results, facts: RunFacts) -> tuple[tuple[str, str], ...]:
    rows = [
        ("Rig", rig_names(results.rigs)),
        ("Scale", facts.scale),
        ("Seed", str(facts.seed)),
        *facts.sizes,
    ]
    for tuning in results.tunings:
        casts = tuning.facts.get("simulated_casts", 0)
        rows.append(
            (
                f"Tuned, {cable_name(tuning.cable)}",
                f"{simulator_name(tuning.simulator)} by {optimizer_name(tuning.optimizer)}, "
                f"{thousands(casts)} simulated casts, seed {tuning.facts.get('seed', '–')}"
                f"{_doubts(tuning.facts)}",
            )
        )
    for (cable, folder), policy in results.policies.items():
        name = policy_label(*folder.rsplit("-", 1))
        told = {k: v for k, v in policy["examples"].items() if k not in ("cable", "mixtures")}
        examples = ", ".join(f"{k.replace('_', ' ')} {v}" for k, v in told.items())
        rows.append(
            (
                f"Trained, {cable_name(cable)}",
                f"{name}: {examples}; best after {policy['best_epoch']} of {policy['epochs']} "
                f"passes, median error on validation {1000 * policy['validation_median_m']:.0f} mm",
            )
        )
    return tuple(rows)


def _doubts(facts: dict) -> str:
    """Return what to know before trusting tuned parameters, empty when there is nothing."""
    bounds = [name for name, p in facts.get("parameters", {}).items() if p.get("at_bound")]
    vague, lost = facts.get("certainty", {}).get("vague"), facts.get("diverged_casts")
    said = [
        f"{thousands(lost)} diverged" if lost else "",
        f"at a bound: {', '.join(bounds)}" if bounds else "",
        f"hardly told by the casts: {', '.join(vague)}" if vague else "",
        "" if "certainty" in facts else "too few casts to say how well these tell the parameters",
    ]
    return "".join(f"; {words}" for words in said if words)


_COMMANDS = (
    ("make repro", "Run what changed since the last run, then write this page again."),
    ("dvc repro -s evaluate", "Run one stage by itself; any stage of dvc.yaml can stand there."),
    (
        "python stages/tune.py -m hydra/launcher=joblib optimizer=de,bo,gn",
        "Compare optimizers side by side, outside the results.",
    ),
    (
        "python stages/diagnose.py measurements=DIR output=DIR",
        "Learn which physical effect the model lacks.",
    ),
    (
        "dvc exp run -S effects=board_tilt",
        "Add an effect to the model and run what follows; its error joins the ladder above.",
    ),
    (
        "python stages/train.py cable=cable2 dataset=real",
        "Train one policy on one cable; evaluate.py takes the same two settings.",
    ),
    (
        "python stages/tune.py rig=recorded rig.path=DIR",
        "Tune to casts you measured yourself: DIR holds a measurement set.",
    ),
    ("scale: paper", "Written in params.yaml, it runs the paper’s sizes."),
)
