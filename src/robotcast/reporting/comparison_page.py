"""The page that lays a model's predictions beside the measured casts, and its blocks.

All is made from the dict of `comparison.json` alone. A page that shows any block includes
blocks.css in its style, and casts.js at its end if it shows `casts_block`.
"""

import json
import shlex
from collections.abc import Mapping
from typing import Any

from markupsafe import Markup

from robotcast.reporting.comparison_figures import (
    course_figure,
    error_bars,
    factor_figure,
    in_plane,
    player,
    residual_map,
)
from robotcast.reporting.names import factor_label, rig_name
from robotcast.reporting.page import block, render
from robotcast.reporting.style import inline

Comparison = Mapping[str, Any]

_DOUBT = 0.05
_WORST = 6
_BLOCKS = "blocks.html"


def comparison_page(comparison: Comparison) -> str:
    """Return the page of a comparison.

    Parameters
    ----------
    comparison : `Comparison.as_dict()` with `rig`, `measurements` (the folder of the set),
        `model` (what predicted, in a few words) and `notes` (list of sentences on limits of the
        data).
    """
    chosen = [*comparison.get("overrides", ()), f"measurements={comparison['measurements']}"]
    return render(
        "comparison.html",
        c=comparison,
        words=comparison["words"],
        state=_state(comparison),
        rig=rig_name(comparison["rig"]),
        command=shlex.join(["python", "stages/diagnose.py", *chosen, "output=OUT"]),
        bars=inline(error_bars(comparison), "Errors beside the noise floor"),
        slices=slices_block(comparison),
        time=time_block(comparison),
        map=map_block(comparison),
        factors=factors_block(comparison),
        casts=casts_block(comparison),
    )


def _state(comparison: Comparison) -> str:
    """Return "missing" when the model errs by more than noise, "within" when it does not.

    And "open" when the repeats are too few to tell.
    """
    fit = comparison["lack_of_fit"]
    if fit is None or fit["smallest_p_value"] > _DOUBT:
        return "open"
    return "missing" if fit["p_value"] <= _DOUBT else "within"


def slices_block(comparison: Comparison) -> Markup:
    """The slices that hold most of the error, one sentence each."""
    return block(_BLOCKS, "slices", comparison)


def time_block(comparison: Comparison) -> Markup:
    """Error over time with the phases of the motion."""
    return block(_BLOCKS, "time", comparison, inline(course_figure(comparison), "Error over time"))


def map_block(comparison: Comparison) -> Markup:
    """Arrows from measured to predicted on the board; empty for signals that are no place."""
    if not in_plane(comparison):
        return Markup("")
    moving = inline(residual_map(comparison, "moving"), "Errors while it moves")
    rest = inline(residual_map(comparison, "rest"), "Errors where it ends")
    return block(_BLOCKS, "map", comparison, moving, rest)


def factors_block(comparison: Comparison) -> Markup:
    """Error against every number of the action; empty when none varies."""
    names = comparison["factors"]
    figures = [inline(factor_figure(comparison, name), f"Error against {name}") for name in names]
    return block(_BLOCKS, "factors", comparison, figures) if figures else Markup("")


def casts_block(comparison: Comparison) -> Markup:
    """Every trial: the worst as pictures, a table to sort, and a player of the chosen one.

    The player's script knows nothing of axes: it gets paths in the drawing's own places.
    """
    figure, paths = player(comparison)
    stage = Markup('<g class="stage" fill="none"></g></svg>')
    frame = inline(figure, "The chosen path").replace("</svg>", stage)
    words = comparison["words"]
    data = {"unit": comparison["error_unit"], "word": words["trial"], "trials": paths}
    text = json.dumps(data, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    trials = sorted(comparison["trials"], key=lambda t: -t["waypoint_percent"])
    worst = {t["group"]: t for t in reversed(trials)}  # of every group
    worst = sorted(worst.values(), key=lambda t: -t["waypoint_percent"])[:_WORST]
    drawn = {path["trial"]: path for path in paths}
    return block(
        _BLOCKS,
        "casts",
        comparison,
        worst=[(t, drawn[t["trial"]]) for t in worst],
        frame=frame,
        frame_height=72 * figure.get_figheight() - 50,
        data=Markup(text.replace("<", "\\u003c")),  # safe inside a script element
        factors=[
            (name, factor_label(name, words["factor_units"].get(name, "")))
            for name in trials[0]["factors"]
        ],
        trials=trials,
    )
