"""What a diagnosis says, as plain data for `diagnosis.json` and its page."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.screen import Screened
from robotcast.diagnosis.search import Found, Rung
from robotcast.diagnosis.sizes import sizes
from robotcast.diagnosis.unexplained import Unexplained


def verdict(found: Found, n_fixed: int, left: Unexplained | None) -> list[str]:
    """Return the effects that are missing, or ["none"], or ["unknown"]."""
    added = list(found.ladder[-1].revision.effects[n_fixed:]) if found.ladder else []
    return added or (["unknown"] if left else ["none"])


def sentence(inquiry: Inquiry, found: Found, named: Sequence[str], left: Unexplained | None) -> str:
    """Say the verdict in one sentence."""
    base, top = found.ladder[0], found.ladder[-1]
    before, after = (float(rung.errors.waypoint.mean()) for rung in (base, top))
    unit = inquiry.model.error_unit
    if named == ["none"]:
        return (
            f"No effect of the library makes the model predict held-out trials better: "
            f"the error stays at {before:.2f} {unit}."
        )
    if named == ["unknown"]:
        depends_on = inquiry.model.effects[left.field].depends_on if left else ""
        return (
            f"Something is missing that the library does not hold: a force that depends on "
            f"{depends_on} explains what the model misses."
        )
    names = " and ".join(inquiry.model.effects[name].text for name in named)
    return (
        f"The model lacks this: {names}. With it the error on held-out trials falls from "
        f"{before:.2f} to {after:.2f} {unit}."
    )


def ladder(found: Found) -> list[dict[str, Any]]:
    """Return the rungs of the error ladder."""
    return [_rung(rung) for rung in found.ladder]


def _rung(rung: Rung) -> dict[str, Any]:
    errors = rung.errors.waypoint
    return {
        "effects": list(rung.revision.effects),
        "heldout_waypoint_error_percent": float(errors.mean()),
        "heldout_final_error_percent": float(np.median(rung.errors.final)),
        "predicted_waypoint_error_percent": rung.predicted,
        "standard_error_percent": float(errors.std() / np.sqrt(len(errors))),
    }


def ranking(inquiry: Inquiry, found: Found) -> list[dict[str, Any]]:
    """Return every effect of the first screen, the most promising first.

    Effects that cannot be judged stand last, each with the reason.
    """
    if not found.screens:
        return []
    later = {name: one for screens in found.screens[1:] for name, one in screens.items()}
    rows = []
    for name, one in found.screens[0].items():
        rows.append((_order(found, one), _row(inquiry, found, name, one, later.get(name))))
    return [row for _, row in sorted(rows, key=lambda pair: pair[0])]


def _order(found: Found, one: Screened) -> tuple:
    names = [rung.revision.effects[-1] for rung in found.ladder[1:]]
    rank = names.index(one.effect) if one.effect in names else len(names)
    return (one.status is not None, rank, one.effect not in found.refits, one.loss)


def _row(
    inquiry: Inquiry, found: Found, name: str, one: Screened, later: Screened | None
) -> dict[str, Any]:
    on_ladder = any(name in rung.revision.effects for rung in found.ladder)
    rung = found.refits.get(name)
    if on_ladder and name in found.ladder[-1].revision.effects:
        rung = found.ladder[-1]
    status = one.status or ("confirmed" if on_ladder else "refitted" if rung else "screened")
    shown: dict[str, Any] = {}
    if rung:
        own = sizes(inquiry, rung.revision, rung.errors.vectors)
        first = len(inquiry.model.parameters)
        for effect in rung.revision.effects:
            n = len(inquiry.model.effects[effect].parameters)
            if effect == name:
                shown = {s.parameter.name: s.as_dict() for s in own[first : first + n]}
            first += n
    confusable = list(found.rivals.get(name, ()))
    confusable += [e for e, rivals in found.rivals.items() if name in rivals]
    return {
        "effect": name,
        "text": inquiry.model.effects[name].text,
        "p_value": one.p_value,
        "parameters": shown,
        "predicted_waypoint_error_percent": one.predicted,
        "realised_waypoint_error_percent": float(rung.errors.waypoint.mean()) if rung else None,
        "power": one.power,
        "confusable_with": confusable,
        "status": status,
        "slices": [],
        "first_in_resamples": None,
    }


def confusion_set(found: Found) -> list[list[str]]:
    """Return the sets of effects that the trials cannot tell apart, the named one first."""
    added = [name for rung in found.ladder[1:] for name in rung.revision.effects[-1:]]
    return [[name, *found.rivals[name]] for name in added if found.rivals.get(name)]
