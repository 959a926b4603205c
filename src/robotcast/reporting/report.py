"""Gathers tables, figures and page from results, and writes them for people."""

from pathlib import Path

from robotcast.files import write_text
from robotcast.reporting.figures.style import style
from robotcast.reporting.glance import glance_of
from robotcast.reporting.names import cable_name, rig_names
from robotcast.reporting.page import Page
from robotcast.reporting.results import Results
from robotcast.reporting.run_facts import RunFacts, run_rows
from robotcast.reporting.sections.cables import cables_section
from robotcast.reporting.sections.parts import parts_section
from robotcast.reporting.sections.policies import policies_section
from robotcast.reporting.sections.revisions import revisions_section
from robotcast.reporting.sections.tuning import tuning_section
from robotcast.reporting.tables.cables import cables_table
from robotcast.reporting.tables.parts import parts_table
from robotcast.reporting.tables.policies import policies_table
from robotcast.reporting.tables.tuning import tuning_table

VIRTUAL_WARNING = (
    "The virtual rig is not a robot. It is a finer simulation of another make, with camera "
    "pictures drawn from it; it stands in for the robot so that the whole pipeline can run "
    "anywhere. Its numbers show that the pipeline works, not how a real cable behaves."
)


RECORDED_WARNING = (
    "Nothing was executed for these policies: the casts are recorded ones, so a policy is judged "
    "by how far its forward model’s endpoint lies from the measured endpoint of held-out casts."
)


def write_report(results: Results, facts: RunFacts, folder: Path) -> list[Path]:
    """Write tables/, figures/ and index.html into `folder`; return what was written."""
    written = []
    for make_table in (tuning_table, policies_table, cables_table, parts_table):
        table = make_table(results)
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
            tuning_section(results),
            *revisions_section(results),
            policies_section(results),
            cables_section(results),
            *parts_section(results),
        )
    names = ", ".join(cable_name(c.name) for c in results.cables)
    return Page(
        lead=(
            f"{names} on the {rig_names(results.rigs)}, {facts.scale} scale: casts are tracked in "
            "camera video, a simulator is tuned to them, many casts are simulated, and policies "
            "learn from both to lay the free end of the cable on a target."
        ),
        warnings=tuple(warnings),
        glance=glance_of(results),
        sections=sections,
        run=run_rows(results, facts),
        commands=_COMMANDS,
    )


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
        "python stages/tune.py paths.measurements=DIR paths.tuned=OUT",
        "Tune to casts you measured yourself: DIR holds a measurement set.",
    ),
    ("scale: paper", "Written in params.yaml, it runs the paper’s sizes."),
)
