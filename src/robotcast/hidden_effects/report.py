"""Writing the benchmark's results for people."""

from collections.abc import Sequence
from pathlib import Path

from robotcast.files import write_text
from robotcast.hidden_effects.figures import confusion_figure, power_figure
from robotcast.hidden_effects.outcome import Outcome
from robotcast.hidden_effects.tables import (
    case_rows,
    criteria_rows,
    csv_text,
    markdown,
    method_rows,
    size_rows,
)
from robotcast.reporting.style import style, svg

TITLES = {
    "criteria": "What is asked of the diagnosis",
    "methods": "Beside other methods",
    "sizes": "Sizes of effects",
    "cases": "Every case",
}


def write_results(outcomes: Sequence[Outcome], folder: Path) -> list[Path]:
    """Write README.md with all tables, each as CSV, and the two figures; return the paths."""
    rows = {
        "criteria": criteria_rows(outcomes),
        "methods": method_rows(outcomes),
        "sizes": size_rows(outcomes),
        "cases": case_rows(outcomes),
    }
    files = {f"{name}.csv": csv_text(table) for name, table in rows.items()}
    with style():
        files["confusion.svg"] = svg(confusion_figure(outcomes)).decode()
        files["power.svg"] = svg(power_figure(outcomes)).decode()
    tables = [f"## {TITLES[name]}\n\n{markdown(table)}" for name, table in rows.items()]
    tables.insert(
        2,
        "![Which effect was named where which was hidden](confusion.svg)\n\n"
        "![How often an effect is named against how far it moves the paths](power.svg)\n",
    )
    files["README.md"] = "\n".join([_opening(outcomes), *tables])
    for name, text in files.items():
        write_text(folder / name, text)
    return [folder / name for name in files]


def _opening(outcomes: Sequence[Outcome]) -> str:
    run = sum(o.diagnosis is not None for o in outcomes)
    return (
        "# Hidden effects\n\n"
        f"{len(outcomes)} sets of casts were measured on the virtual rig, a 3-D cable with "
        "contacts that shares no code with the simulators; each hides an effect, two, "
        "something that no diagnosis has a name for, or nothing. "
        f"{run} of them were diagnosed. Errors are average waypoint errors on held-out casts in "
        "% of cable length; a shift is how far the hidden effect moves the paths.\n"
    )
