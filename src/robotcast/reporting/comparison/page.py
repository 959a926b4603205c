"""The comparison page: one HTML file, made from the dict of `comparison.json` alone."""

import shlex
from collections.abc import Mapping
from typing import Any

from robotcast.reporting.comparison import blocks
from robotcast.reporting.comparison.verdict import verdict
from robotcast.reporting.html import environment, style, template
from robotcast.reporting.names import rig_name

_ROOM = "robotcast.reporting.comparison"


def comparison_page(comparison: Mapping[str, Any]) -> str:
    """Return the page of a comparison.

    Parameters
    ----------
    comparison : `Comparison.as_dict()` with `rig`, `measurements` (the folder of the set),
        `model` (what predicted, in a few words) and `notes` (list of sentences on limits of the
        data).
    """
    return (
        environment()
        .from_string(template(_ROOM, "comparison.html"))
        .render(
            css=style(template(_ROOM, "comparison.css"), blocks.blocks_style()),
            script=blocks.blocks_script(),
            c=comparison,
            words=comparison["words"],
            verdict=verdict(comparison),
            source=_source(comparison),
            command=_command(comparison),
            bars=blocks.bars_block(comparison),
            slices=blocks.slices_block(comparison),
            time=blocks.time_block(comparison),
            map=blocks.map_block(comparison),
            factors=blocks.factors_block(comparison),
            casts=blocks.casts_block(comparison),
        )
    )


def _source(comparison: Mapping[str, Any]) -> str:
    """Say what was compared with what."""
    count, groups = len(comparison["trials"]), comparison["groups"]
    trials = comparison["words"]["trials" if count != 1 else "trial"]
    actions = f"{groups} action{'s' if groups != 1 else ''}"
    rig = rig_name(comparison["rig"])
    return (
        f"set {comparison['measurements']} · {count} {trials} of {actions} · "
        f"measured on the {rig} · predicted by {comparison['model']}"
    )


def _command(comparison: Mapping[str, Any]) -> str:
    chosen = [*comparison.get("overrides", ()), f"measurements={comparison['measurements']}"]
    return shlex.join(["python", "stages/diagnose.py", *chosen, "output=OUT"])
