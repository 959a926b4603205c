"""The section on what the errors are made of and where they are."""

from robotcast.reporting.figures.board_errors import board_errors_figure
from robotcast.reporting.figures.style import svg
from robotcast.reporting.names import rig_names
from robotcast.reporting.page import PageFigure, Section
from robotcast.reporting.results import Results
from robotcast.reporting.sections.endpoints import in_order
from robotcast.reporting.tables.parts import parts_table


def parts_section(results: Results) -> tuple[Section, ...]:
    """Say what the errors are made of and where they are; no section where nothing was cast."""
    cast = [e for e in results.evaluations if e.kind == "executed" and len(e.casts)]
    if not cast:
        return ()
    figure = PageFigure(
        "board_errors",
        "Where on the board policies miss",
        "One disc a target; its colour and number are the median error of the casts at it, in % "
        f"of cable length. {rig_names(results.rigs).capitalize()}.",
        svg(board_errors_figure(in_order(cast))),
    )
    text = (
        "Repeats of one action come to rest apart, which no policy can help; what is left is the "
        "model’s: the gap between simulation and rig, and what learning missed."
    )
    title = "How much of the error is the model’s?"
    return (Section(title, text, parts_table(results), (figure,)),)
