"""The blocks of the comparison page, each an HTML fragment that another page can embed.

A page that shows any of them includes `blocks_style()` once in its style, and `blocks_script()`
once at its end if it shows `casts_block`.
"""

from collections.abc import Mapping
from typing import Any

from markupsafe import Markup

from robotcast.reporting.comparison.bars import error_bars
from robotcast.reporting.comparison.board import residual_map
from robotcast.reporting.comparison.course import course_figure
from robotcast.reporting.comparison.factors import factor_figures
from robotcast.reporting.comparison.labels import factor_label
from robotcast.reporting.comparison.paths import player_data, player_frame, worst_paths
from robotcast.reporting.comparison.plane import in_plane
from robotcast.reporting.html import environment, template
from robotcast.reporting.numbers import error, number

_ROOM = "robotcast.reporting.comparison"


def blocks_style() -> Markup:
    """Return the style that the blocks need beside that of every page."""
    return Markup(template(_ROOM, "blocks.css"))


def blocks_script() -> Markup:
    """Return the script element that makes the blocks sortable and playable."""
    return Markup("<script>\n{}</script>").format(Markup(template(_ROOM, "casts.js")))


def bars_block(comparison: Mapping[str, Any]) -> Markup:
    """Both errors as bars beside the noise floor."""
    return error_bars(comparison)


def slices_block(comparison: Mapping[str, Any]) -> Markup:
    """The slices that hold most of the error, one sentence each."""
    return _block("slices", comparison)


def time_block(comparison: Mapping[str, Any]) -> Markup:
    """Error over time with the phases of the motion."""
    return _block("time", comparison, figure=course_figure(comparison))


def map_block(comparison: Mapping[str, Any]) -> Markup:
    """Arrows from measured to predicted on the board; empty for signals that are no place."""
    if not in_plane(comparison):
        return Markup("")
    return _block(
        "map",
        comparison,
        moving=residual_map(comparison, "moving"),
        rest=residual_map(comparison, "rest"),
    )


def factors_block(comparison: Mapping[str, Any]) -> Markup:
    """Error against every number of the action; empty when none varies."""
    figures = factor_figures(comparison)
    return _block("factors", comparison, figures=figures) if figures else Markup("")


def casts_block(comparison: Mapping[str, Any]) -> Markup:
    """Every trial: the worst as pictures, a table to sort, and a player of the chosen one."""
    units = comparison["words"]["factor_units"]
    names = list(comparison["trials"][0]["factors"])
    most = max(t["waypoint_percent"] for t in comparison["trials"])
    return _block(
        "casts",
        comparison,
        worst=worst_paths(comparison),
        frame=player_frame(comparison),
        data=player_data(comparison),
        factors=[(name, factor_label(name, units.get(name, ""))) for name in names],
        trials=sorted(comparison["trials"], key=lambda t: -t["waypoint_percent"]),
        most=most,
    )


def _block(name: str, comparison: Mapping[str, Any], **given: Any) -> Markup:
    made = environment()
    made.filters.update(error=error, number=number)
    macros = made.from_string(template(_ROOM, "blocks.html")).module
    return getattr(macros, name)(comparison, **given)
