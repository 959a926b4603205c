"""The section on how the error falls as effects are added."""

from robotcast.reporting.names import cable_name, rig_name
from robotcast.reporting.page import PageFigure, Section
from robotcast.reporting.results import Results
from robotcast.reporting.revisions.rungs import comparable


def revisions_section(results: Results) -> tuple[Section, ...]:
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
