"""The section on which data make the better policy."""

from robotcast.reporting.figures.errors import errors_figure
from robotcast.reporting.figures.style import svg
from robotcast.reporting.names import cable_name, rig_names
from robotcast.reporting.page import PageFigure, Section
from robotcast.reporting.results import Results
from robotcast.reporting.sections.endpoints import in_order, targets_of
from robotcast.reporting.tables.policies import policies_table

_RESIDUAL = (
    "Residual learned from simulated casts first, and then from measured ones how they depart from "
    "what it had learned. "
)


def policies_section(results: Results) -> Section:
    """Set policies beside each other, and what each learned from."""
    ordered = in_order(e for e in results.evaluations if len(e.casts))
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
            figures.append(targets_of(results, several, f"targets_{cable}", cable_name(cable)))
    text = (
        "A policy looks up, among the feasible candidate actions, the one that it expects to miss "
        "the target least, and moves on from it along the model’s gradient. "
        "π_RD learned from measured casts, π_SD from simulated ones, "
        "π_R2S2R from both. "
        f"{_RESIDUAL if any(e.policy == 'residual' for e in ordered) else ''}"
        "All are tested on the same targets."
    )
    title = "Which data make the better policy?"
    return Section(title, text, policies_table(results), tuple(figures))
