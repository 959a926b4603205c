"""The section on how well tuned simulators match."""

from robotcast.reporting.best import best_tuning
from robotcast.reporting.figures.overlay import overlay_figure
from robotcast.reporting.figures.style import svg
from robotcast.reporting.figures.trace import trace_figure
from robotcast.reporting.names import cable_name, rig_name
from robotcast.reporting.page import PageFigure, Section
from robotcast.reporting.results import Results
from robotcast.reporting.tables.tuning import tuning_table


def tuning_section(results: Results) -> Section:
    """Set tuned simulators beside held-out casts and the noise floor."""
    figures = []
    lengths = {c.name: c.measured.cable.length_m for c in results.cables if c.measured}
    for cable in results.cables:
        tuning = best_tuning(results, cable.name)
        paths = tuning.test_paths if tuning else None
        if tuning is None or paths is None or tuning.cable not in lengths:
            continue
        figures.append(
            PageFigure(
                f"overlay_{tuning.cable}_{tuning.slug}",
                f"{cable_name(tuning.cable)}, {tuning.method}: measured and simulated paths",
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
