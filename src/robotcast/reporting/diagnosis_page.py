"""The diagnosis page: one HTML file, made from the dict of `diagnosis.json` alone.

Its prose stands in diagnosis.html and next_steps.html, chosen by codes.
"""

import json
import re
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path, PurePosixPath
from types import SimpleNamespace
from typing import Any, Literal

from markupsafe import Markup

from robotcast.diagnosis.model import parameter_name
from robotcast.files import write_text
from robotcast.reporting.comparison_page import casts_block, where_blocks
from robotcast.reporting.missing_force import drafts, field_figure, focus, robot_block, strongest
from robotcast.reporting.names import (
    effect_name,
    error,
    factor_name,
    number,
    rig_name,
    with_interval,
    with_unit,
)
from robotcast.reporting.page import render
from robotcast.reporting.style import Bar, Row, bars, fall, inline, spread
from robotcast.running import write_page

State = Literal["running", "too-few", "unknown", "none", "near", "open", "confused", "found"]

# what a stage adds to what a diagnosis tells
_BY_STAGE: dict[str, Any] = {
    **dict.fromkeys(("rig", "measurements", "output"), ""),
    **dict.fromkeys(("overrides", "casts_on"), ()),
    **dict.fromkeys(("robot", "patched")),
    "pipeline": False,
}
_NOT_ACTIONS = ("separates", "difference_percent", "why")


def write_diagnosis(folder: Path, diagnosis: Mapping[str, Any]) -> None:
    """Write `diagnosis.json`, and `index.html`, the page of it."""
    text = json.dumps(diagnosis, ensure_ascii=False, allow_nan=False, indent=1)
    write_text(folder / "diagnosis.json", text)
    write_page(folder / "index.html", diagnosis_page(diagnosis))


def diagnosis_page(diagnosis: Mapping[str, Any]) -> str:
    """Return the page of a diagnosis, whole or while it runs, with what its stage adds, if any."""
    d = _read(diagnosis)
    c, keys = d.comparison, dict.fromkeys(key for trial in d.next_actions for key in trial)
    factors = [name for name in keys if name not in _NOT_ACTIONS]
    return render(
        "diagnosis.html",
        d=d,
        words=d.words,
        state=_state(d),
        rivals=_rivals(d),
        ladder=_ladder(d),
        sizes=_sizes,
        explained=[(r, _slices(r["slices"], d.unit)) for r in d.ranking if r.get("slices")],
        missing=_missing(d),
        drafts=drafts(d.unexplained) if d.unexplained and d.pipeline else {},
        factors=[(n, factor_name(n), d.words["factor_units"].get(n, "")) for n in factors],
        outputs=_outputs(d),
        where=_where(json.dumps(c)) if c else None,
        robot=robot_block(d.robot, d.patched) if d.robot else "",
        # what reloads itself cannot play
        casts=casts_block(c) if c and d.finished and not d.robot else None,
        rig=rig_name(d.rig),
        parameter_name=parameter_name,
    )


@lru_cache(maxsize=1)  # a page that is rewritten while a diagnosis runs shows the same again
def _where(comparison: str) -> dict[str, Markup]:
    return where_blocks(json.loads(comparison))


def _read(diagnosis: Mapping[str, Any]) -> SimpleNamespace:
    """Return the diagnosis with `found`, the effects that the verdict names.

    And with `effects`, all of its last model; `unit` and `error_name`, "%" and "of cable length".
    """
    d = SimpleNamespace(**{**_BY_STAGE, **diagnosis})
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
    if not d.ladder:
        return None
    rows: list[Row] = []
    above, before = None, None
    for entry in d.ladder:
        effects, reached = set(entry["effects"]), entry["heldout_typical_error_percent"]
        added = effects - before if before is not None and before < effects else set()
        names = " + ".join(map(effect_name, sorted(added or effects)))
        name = f"{'+' if added else 'with'} {names}" if names else "base model"
        mean, final = (entry[f"heldout_{of}_error_percent"] for of in ("waypoint", "final"))
        whisker = spread(reached, entry["standard_error_percent"])
        bar = Bar(reached, "before" if before is None else "model", fall(above, reached), whisker)
        detail = f"mean {error(mean, d.unit)}, final {error(final, d.unit)}"
        rows.append(Row(name, (bar,), detail))
        above, before = reached, effects
    left = d.unexplained
    if left and (reached := left["heldout_typical_error_percent"]) is not None:
        detail = f"by {left['depends_on']}"
        rows.append(Row("fitted field", (Bar(reached, "open", fall(above, reached)),), detail))
    axis = f"typical error on held-out {d.words['trials']} [{d.error_unit}]"
    drawn = bars(rows, axis, d.noise_floor_percent, d.unit)
    return inline(drawn, f"Error ladder of {len(rows)} models")


def _slices(slices: list[dict[str, Any]], unit: str) -> Markup:
    """Draw one pair of bars a slice: grey without the effect, blue with it."""
    rows = [
        Row(s["slice"], (Bar(s["before_percent"], "before"), Bar(s["after_percent"])))
        for s in slices
    ]
    wide = max(190.0, 7.4 * max(len(s["slice"]) for s in slices) + 12)
    figure = bars(rows, unit=unit, width=410 + wide, names=wide)
    return inline(figure, "Error before and after, by slice")


def _missing(d: SimpleNamespace) -> dict[str, Any] | None:
    """Draw what is missing, if it was fitted as a field."""
    field = d.unexplained["field"] if d.unexplained else None
    if not field:
        return None
    aimed = focus(field)
    place = ", ".join(number(float(v)) for v in aimed[0]) if aimed else ""
    return {
        "figure": inline(field_figure(field), "What is missing"),
        "strongest": strongest(field),
        "acts_on": field["acts_on"],
        "place": place,
        "towards": aimed is not None and aimed[1],
    }


def _sizes(parameters: Mapping[str, Mapping[str, Any]] | None) -> list[dict[str, Any]]:
    """Return parameters as they are shown: a name, a value, an interval, and their whisker."""
    return [_size(name, **given) for name, given in (parameters or {}).items()]


def _size(
    name: str, value: float, low: float | None, high: float | None, unit: str, null: float | None
) -> dict[str, Any]:
    shown, least, most = with_interval(value, low, high)
    # where value, ends of the interval and null lie across a whisker, in pixels
    marks = [value, value if low is None else low, value if high is None else high, null]
    ends = [m for m in marks if m is not None]
    wide = max(ends) - min(ends) or abs(value) or 1.0
    scale, start = 112 / (1.16 * wide), min(ends) - 0.08 * wide
    return {
        "name": name,
        "unit": unit,
        "value": with_unit(shown, unit),
        "interval": "" if low is None or high is None else f"[{least}, {most}]",
        "null": null,
        "places": [m if m is None else round(4 + scale * (m - start), 2) for m in marks],
    }


def figures_told(diagnosis: Mapping[str, Any]) -> Iterator[str]:
    """Yield the sizes of what the verdict names, and the noise floor, as a terminal shows them."""
    for size in _sizes((diagnosis["model"] or {}).get("parameters")):
        effect, _, own = size["name"].rpartition(".")
        if effect in diagnosis["verdict"]:
            interval = f", 95 % interval {size['interval']}" if size["interval"] else ""
            name = parameter_name(own, size["unit"])
            yield f"{effect_name(effect)}: {name} = {size['value']}{interval}"
    if diagnosis["noise_floor_percent"] is not None:
        yield f"noise floor {error(diagnosis['noise_floor_percent'], diagnosis['error_unit'])}"


def _outputs(d: SimpleNamespace) -> str:
    """Return a folder for all that is tuned to this set, so that its revisions compare."""
    name = re.sub(r"[^\w.-]+", "_", PurePosixPath(d.measurements).name)
    return f"outputs/{name or 'set'}"
