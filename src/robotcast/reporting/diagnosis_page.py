"""The diagnosis page: one HTML file, made from the dict of `diagnosis.json` alone.

Its prose stands in diagnosis.html and next_steps.html, chosen by codes.
"""

import json
import re
import shlex
from collections.abc import Mapping
from functools import lru_cache
from pathlib import PurePosixPath
from types import SimpleNamespace
from typing import Any, Literal

from markupsafe import Markup
from matplotlib.figure import Figure

from robotcast.diagnosis.wording import PLAIN, parameter_name
from robotcast.reporting.comparison_page import (
    casts_block,
    factors_block,
    map_block,
    slices_block,
    time_block,
)
from robotcast.reporting.ladder import Rung, ladder
from robotcast.reporting.missing_force import drafts, field_figure, focus, strongest
from robotcast.reporting.names import effect_name, factor_name, rig_name
from robotcast.reporting.numbers import error, number, with_interval, with_unit
from robotcast.reporting.page import render
from robotcast.reporting.robot_page import robot_block
from robotcast.reporting.style import BLUE, GREY, beside, canvas, hint, inline, style

State = Literal["running", "too-few", "unknown", "none", "near", "open", "confused", "found"]

_NOT_KNOWN: dict[str, Any] = {
    **dict.fromkeys(("casts", "actions", "noise_floor_percent", "comparison"), None),
    **dict.fromkeys(("simulated_casts", "seconds", "unexplained", "robot", "patched"), None),
    **dict.fromkeys(("code", "sentence", "rig", "measurements", "output"), ""),
    **dict.fromkeys(("verdict", "confusion_set", "nearest", "overrides", "notes"), ()),
    **dict.fromkeys(("ladder", "ranking", "next_actions"), ()),
    "words": PLAIN.as_dict(0),
    "conclusive": True,
    "pipeline": False,
    "error_unit": "%",
    "base": {},
    "finished": True,
    "doing": "starting",
}
_NOT_ACTIONS = ("separates", "difference_percent", "why")


def diagnosis_page(diagnosis: Mapping[str, Any]) -> str:
    """Return the page of a diagnosis, whole or while it runs; keys it lacks are not known."""
    d = _read(diagnosis)
    c = d.comparison
    return render(
        "diagnosis.html",
        d=d,
        words=d.words,
        state=_state(d),
        rivals=_rivals(d),
        ladder=_ladder(d),
        sizes=_sizes,
        explained=[
            (r, inline(_slices_figure(r["slices"], d.unit), "Error before and after, by slice"))
            for r in d.ranking
            if r.get("slices")
        ],
        missing=_missing(d),
        drafts=drafts(d.unexplained) if d.unexplained and d.pipeline else {},
        factors=[
            (name, factor_name(name), d.words["factor_units"].get(name, ""))
            for name in dict.fromkeys(key for trial in d.next_actions for key in trial)
            if name not in _NOT_ACTIONS
        ],
        tune=_tune_command(d),
        pipeline=_pipeline_command(d),
        outputs=_outputs(d),
        actions=shlex.quote(f"{d.output}/actions.csv"),
        where=_where(json.dumps(c)) if c else None,
        robot=robot_block(d.robot, d.patched) if d.robot else "",
        casts=casts_block(c)
        if c and d.finished and not d.robot
        else None,  # what reloads itself cannot play
        rig=rig_name(d.rig),
        parameter_name=parameter_name,
    )


@lru_cache(maxsize=1)  # a page that is rewritten while a diagnosis runs shows the same again
def _where(comparison: str) -> dict[str, Markup]:
    """Return the blocks that show where the base model fails."""
    c = json.loads(comparison)
    blocks = {
        "slices": slices_block,
        "time": time_block,
        "map": map_block,
        "factors": factors_block,
    }
    return {name: block(c) for name, block in blocks.items()}


def _read(diagnosis: Mapping[str, Any]) -> SimpleNamespace:
    """Return the diagnosis with `found`, the effects that the verdict names.

    And with `effects`, all of its last model; `unit` and `error_name`, "%" and "of cable length".
    """
    d = SimpleNamespace(**_NOT_KNOWN)
    vars(d).update((key, value) for key, value in diagnosis.items() if value is not None)
    d.unit, _, d.error_name = d.error_unit.partition(" ")
    d.found = [v for v in d.verdict if v not in ("none", "unknown")]
    d.effects = list(dict.fromkeys([*(d.ladder[-1]["effects"] if d.ladder else ()), *d.found]))
    return d


def _state(d: SimpleNamespace) -> State:
    if not d.finished:
        return "running"
    if d.code == "unknown" or (d.found and d.unexplained):
        return "unknown"
    if not d.conclusive or not d.ladder:
        return "too-few"
    if d.found:
        return "confused" if _rivals(d) else "found"
    if d.nearest:
        return "near"
    return "open" if d.unexplained or d.code == "cannot tell" else "none"


def _rivals(d: SimpleNamespace) -> list[str]:
    """Return the effects that the trials cannot tell from those that the verdict names."""
    alike = [e for group in d.confusion_set if set(d.found) & set(group) for e in group]
    return [e for e in dict.fromkeys(alike) if e not in d.found]


def _ladder(d: SimpleNamespace) -> Markup | None:
    """Draw the models, and last the fitted field, which no model has climbed yet."""
    rungs: list[Rung] = []
    before: set[str] | None = None
    for entry in d.ladder:
        effects = set(entry["effects"])
        added = before is not None and before < effects
        names = [effect_name(e) for e in sorted(effects - before if added and before else effects)]
        label = f"+ {' + '.join(names)}" if added else f"with {' + '.join(names)}"
        means = (
            ("mean", "heldout_waypoint_error_percent"),
            ("final", "heldout_final_error_percent"),
        )
        rungs.append(
            Rung(
                label=label if names else "base model",
                realised=entry["heldout_typical_error_percent"],
                standard_error=entry["standard_error_percent"],
                detail=", ".join(f"{name} {error(entry[key], d.unit)}" for name, key in means),
                kind="base" if before is None else "model",
                compared_to=rungs[-1].realised if rungs else None,
            )
        )
        before = effects
    if not rungs:
        return None
    left = d.unexplained or {}
    reached = left.get("heldout_typical_error_percent")
    if reached is not None:
        detail = f"any force by {left.get('depends_on') or 'anything'}"
        above = rungs[-1].realised
        rungs.append(Rung("fitted field", reached, detail=detail, kind="open", compared_to=above))
    unit = f"{d.unit} {d.error_name}".rstrip()
    axis = f"typical error on held-out {d.words['trials']} [{unit}]"
    figure = ladder(rungs, d.noise_floor_percent, axis, d.unit)
    return inline(figure, f"Error ladder of {len(rungs)} models")


def _missing(d: SimpleNamespace) -> dict[str, Any] | None:
    """Draw the missing force, if it was fitted as a field."""
    field = d.unexplained.get("field") if d.unexplained else None
    if not field or not field["points"]:
        return None
    aimed = focus(field)
    place = ", ".join(number(float(v)) for v in aimed[0]) if aimed else ""
    return {
        "figure": inline(field_figure(field), "The missing force"),
        "strongest": strongest(field),
        "acts_on": field.get("acts_on") or "the model",
        "place": place,
        "towards": aimed is not None and aimed[1],
    }


@style(on_page=True)
def _slices_figure(slices: list[dict[str, Any]], unit: str) -> Figure:
    """Draw one pair of bars a slice: grey without the effect, blue with it."""
    left = max(190.0, 6.6 * max(len(s["slice"]) for s in slices) + 12)
    figure, axes = canvas(330 + left, 4 + 34 * len(slices), left, 56, 0, 4)
    for row, part in enumerate(slices):
        before, after = part["before_percent"], part["after_percent"]
        words = f"{part['slice']}: {error(before, unit)} without, {error(after, unit)} with it"
        for y, value, fill, color in (
            (-0.16, before, "#b6bdc9", GREY),
            (0.16, after, BLUE, "black"),
        ):
            (bar,) = axes.barh(row + y, value, 0.3, color=fill)
            bar.set_url(hint(words))
            beside(axes, error(value, unit), value, row + y, 6, -4, size=11, color=color)
    axes.set_yticks(range(len(slices)), [s["slice"] for s in slices])
    axes.tick_params(length=0, labelsize=12, labelcolor="black")
    axes.set(ylim=(len(slices) - 0.5, -0.5), xticks=[], xlim=(0, axes.get_xlim()[1] or 1))
    axes.grid(visible=False)
    axes.spines["bottom"].set_visible(False)
    return figure


def _sizes(parameters: Mapping[str, Mapping[str, Any]] | None) -> list[dict[str, Any]]:
    """Return parameters as they are shown: a name, a value, an interval, words and a whisker."""
    rows = []
    for name, given in (parameters or {}).items():
        unit, low, high, null = (given.get(key) for key in ("unit", "low", "high", "null"))
        value, least, most = with_interval(given["value"], low, high)
        words = f"{name} = {with_unit(value, unit or '')}"
        known = low is not None and high is not None
        if known:
            words += f", between {least} and {with_unit(most, unit or '')}"
        if null is not None:
            words += f"; at {with_unit(number(null), unit or '')} the effect does nothing"
        rows.append(
            {
                "name": name,
                "unit": unit,
                "value": with_unit(value, unit or ""),
                "interval": f"[{least}, {most}]" if known else "",
                "words": words,
                "places": _places(given["value"], low, high, null),
            }
        )
    return rows


def _places(value: float, low: float | None, high: float | None, null: float | None) -> list:
    """Return where value, ends of the interval and null lie across a whisker, in pixels."""
    marks = [value, value if low is None else low, value if high is None else high, null]
    known = [m for m in marks if m is not None]
    spread = max(known) - min(known) or abs(value) or 1.0
    start = min(known) - 0.08 * spread
    scale = 112 / (max(known) + 0.08 * spread - start)
    return [None if m is None else round(4 + scale * (m - start), 2) for m in marks]


def _tune_command(d: SimpleNamespace) -> str:
    """Return the command that tunes the model with what was found to the same measurement set."""
    folder = d.measurements if "/" in d.measurements else "DIR"
    parts = [
        "python stages/tune.py",
        *(shlex.quote(override) for override in d.overrides),
        f"paths.measurements={shlex.quote(folder)}",
        *([f"paths.diagnosis={shlex.quote(d.output)}"] if d.output else []),
        f"paths.tuned={_outputs(d)}/{'+'.join(d.effects)}",
        f"'effects=[{','.join(d.effects)}]'",
    ]
    return " ".join(parts)


def _pipeline_command(d: SimpleNamespace) -> str:
    """Return the command that runs the pipeline with what was found.

    To DVC a bare comma is a sweep. A simulator that was chosen for the diagnosis runs alone: others
    may lack other effects.
    """
    names = ",".join(d.effects)
    chosen = f"effects={names}" if len(d.effects) == 1 else f"\"effects='{names}'\""
    of = [o.removeprefix("simulator=") for o in d.overrides if o.startswith("simulator=")]
    alone = "".join(f" -S 'simulators=[{s}]' -S generate.simulator={s}" for s in of)
    return f"dvc exp run -S {chosen}{alone}"


def _outputs(d: SimpleNamespace) -> str:
    """Return a folder for all that is tuned to this set, so that its revisions compare."""
    name = re.sub(r"[^\w.-]+", "_", PurePosixPath(d.measurements).name)
    return f"outputs/{name or 'set'}"
