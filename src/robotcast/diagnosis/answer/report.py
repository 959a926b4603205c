"""What a diagnosis says, as plain data for `diagnosis.json` and its page."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from robotcast.diagnosis.answer.limits import FEWEST_GROUPS, counted, is_ignored
from robotcast.diagnosis.further.next_trials import NextTrial
from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.revision import Revision
from robotcast.diagnosis.search.floor import Floor
from robotcast.diagnosis.search.found import Found, Rung
from robotcast.diagnosis.search.screen import Screened
from robotcast.diagnosis.search.sizes import sizes, sizes_of_effect
from robotcast.diagnosis.search.unexplained import Unexplained
from robotcast.diagnosis.wording import PLAIN, Wording

UNTOUCHED = ("ignored by the model", "touches nothing")  # nothing that is computed says anything


def verdict(found: Found, n_fixed: int, left: Unexplained | None) -> list[str]:
    """Return the effects that are missing, or ["none"], or ["unknown"]."""
    added = list(found.ladder[-1].revision.effects[n_fixed:]) if found.ladder else []
    return added or (["unknown"] if left else ["none"])


def sentence(
    inquiry: Inquiry,
    found: Found,
    named: Sequence[str],
    left: Unexplained | None,
    near: Sequence[Rung],
    floor: Floor,
    wording: Wording = PLAIN,
) -> str:
    """Say the verdict in a sentence, and in others how far the error stays above noise, and why.

    Parameters
    ----------
    named : the verdict.
    near : refits that came near to being named.
    """
    base, top = found.ladder[0], found.ladder[-1]
    before, after = (float(rung.errors.waypoint.mean()) for rung in (base, top))
    unit, trials = inquiry.model.error_unit, wording.trials
    above, far = floor.above(top.errors.waypoint), floor.far_above(top.errors.waypoint)
    times = f"{after / floor.percent:.1f} times what repeats differ by" if floor.percent else ""
    if named == ["none"]:
        said = (
            f"No effect of the library is confirmed: the error on held-out {trials} stays"
            if near
            else f"No effect of the library makes the model predict held-out {trials} better: "
            "the error stays"
        )
        beside = _beside_repeats(f"That is {times}", "something", above, far)
        return f"{said} at {before:.2f} {unit}.{beside}{_nearest(inquiry, near, wording)}"
    if named == ["unknown"]:
        said = "Something is missing that the library does not hold:"
        depends_on = inquiry.model.effects[left.field].depends_on if left else ""
        if left is None or left.enough:
            return f"{said} a force that depends on {depends_on} explains what the model misses."
        return (
            f"{said} the error on held-out {trials} stays at {after:.2f} {unit}, {times}. "
            f"A force that depends on {depends_on} comes nearest.{_nearest(inquiry, near, wording)}"
        )
    names = " and ".join(inquiry.model.effects[name].text for name in named)
    said = (
        f"The model lacks this: {names}. With it the error on held-out {trials} falls from "
        f"{before:.2f} to {after:.2f} {unit}."
    )
    return f"{said}{_beside_repeats(f'That is still {times}', 'more', above, far)}"


def _beside_repeats(that: str, what: str, above: bool, far: bool) -> str:
    if far:
        return f" {that}, so {what} is missing."
    return f" {that}." if above else ""


def _nearest(inquiry: Inquiry, near: Sequence[Rung], wording: Wording) -> str:
    if not near:
        return ""
    texts = " or ".join(inquiry.model.effects[name].text for name in added(near))
    percent = f"{near[0].errors.waypoint.mean():.2f} {inquiry.model.error_unit}"
    return (
        f" It may be this: {texts}. With it the error is {percent}, but these {wording.trials} "
        "do not confirm it."
    )


def sentence_on_too_few(inquiry: Inquiry, wording: Wording) -> str:
    """Say in one sentence that the trials confirm nothing."""
    n, groups = len(inquiry.records), int(inquiry.groups.max()) + 1
    return (
        f"{counted(n, wording.trial, wording.trials)} of "
        f"{counted(groups, wording.group, wording.groups)} "
        f"{'is' if n == 1 else 'are'} too few to tell whether an effect is missing; "
        f"{FEWEST_GROUPS} different {wording.groups} are the least."
    )


def unexplained(
    inquiry: Inquiry,
    left: Unexplained | None,
    draw: Callable[[Inquiry, Unexplained], Mapping[str, Any] | None],
) -> dict[str, Any] | None:
    """Return what the missing force depends on, drawn by `draw`; None when nothing is left."""
    if left is None:
        return None
    field = inquiry.model.effects[left.field]
    like = "What is missing acts like" if left.enough else "Nothing explains it. Nearest comes"
    return {
        "depends_on": field.depends_on,
        "explains": left.enough,
        "text": f"{like} {field.text}.",
        "heldout_waypoint_error_percent": float(left.rung.errors.waypoint.mean()),
        "field": draw(inquiry, left),
    }


def added(rungs: Sequence[Rung]) -> list[str]:
    """Return the last effect of each rung."""
    return [rung.revision.effects[-1] for rung in rungs]


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


def ranking(
    inquiry: Inquiry,
    found: Found,
    near: Sequence[Rung] = (),
    slices: Mapping[str, list[dict[str, Any]]] = {},
    first: Mapping[str, float] = {},
) -> list[dict[str, Any]]:
    """Return every effect of the first screen, the most promising first.

    Effects that cannot be judged stand last, each with the reason.

    Parameters
    ----------
    near : refits that came near to being named.
    slices : refitted effect → the slices of the error before and after it.
    first : refitted effect → how often it comes first in resamples.
    """
    if not found.screens:
        return []
    rows = []
    for name, one in found.screens[0].items():
        row = _row(inquiry, found, near, name, one)
        row |= {"slices": slices.get(name, []), "first_in_resamples": first.get(name)}
        rows.append((_order(found, one), row))
    return [row for _, row in sorted(rows, key=lambda pair: pair[0])]


def held(inquiry: Inquiry, name: str) -> dict[str, Any]:
    """Return the row of an effect that is held where it does nothing."""
    return {
        "effect": name,
        "text": inquiry.model.effects[name].text,
        "p_value": None,
        "parameters": {},
        "predicted_waypoint_error_percent": None,
        "realised_waypoint_error_percent": None,
        "power": None,
        "confusable_with": [],
        "status": "held at its null",
        "slices": [],
        "first_in_resamples": None,
    }


def _order(found: Found, one: Screened) -> tuple:
    names = [rung.revision.effects[-1] for rung in found.ladder[1:]]
    rank = names.index(one.effect) if one.effect in names else len(names)
    return (one.status is not None, rank, one.effect not in found.refits, one.loss)


def _row(
    inquiry: Inquiry, found: Found, near: Sequence[Rung], name: str, one: Screened
) -> dict[str, Any]:
    on_ladder = any(name in rung.revision.effects for rung in found.ladder)
    rung = found.refits.get(name)
    if on_ladder and name in found.ladder[-1].revision.effects:
        rung = found.ladder[-1]
    status = one.status or ("confirmed" if on_ladder else "refitted" if rung else "screened")
    shown: dict[str, Any] = {}
    if rung:
        own = sizes_of_effect(inquiry, rung.revision, rung.errors.vectors, name)
        shown = {size.parameter.name: size.as_dict() for size in own}
    confusable = list(found.rivals.get(name, ()))
    confusable += [e for e, rivals in found.rivals.items() if name in rivals]
    confusable += [e for e in added(near) if e != name and name in added(near)]
    said = status not in UNTOUCHED
    return {
        "effect": name,
        "text": inquiry.model.effects[name].text,
        "p_value": one.p_value if said else None,
        "parameters": shown,
        "predicted_waypoint_error_percent": one.predicted if said else None,
        "realised_waypoint_error_percent": float(rung.errors.waypoint.mean()) if rung else None,
        "power": one.power if said else None,
        "confusable_with": confusable,
        "status": status,
        "slices": [],
        "first_in_resamples": None,
    }


def base_parameters(inquiry: Inquiry, base: Revision, vectors: np.ndarray | None) -> dict[str, Any]:
    """Return the sizes of the base model's parameters.

    One that changes nothing may be any; one that is held has no interval.

    Parameters
    ----------
    vectors : of the folds' fits, (k, n); None when there were none.
    """
    own = sizes(inquiry, base, vectors)[: len(inquiry.model.parameters)]
    rows = {}
    for k, size in enumerate(own):
        parameter = size.parameter
        row = rows[parameter.name] = size.as_dict()
        if parameter.frozen:
            row |= {"low": None, "high": None}
        elif is_ignored(base, k):
            row |= {"low": parameter.lower, "high": parameter.upper}
    return {"parameters": rows}


def next_rows(inquiry: Inquiry, trials: Sequence[NextTrial], wording: Wording) -> list[dict]:
    """Return the next trials: the numbers of their action, what they separate, and why."""
    return [
        {
            **one.record.factors,
            "separates": list(one.contest.names),
            "difference_percent": one.difference_percent,
            "why": _why(inquiry, one, wording),
        }
        for one in trials
    ]


def _why(inquiry: Inquiry, one: NextTrial, wording: Wording) -> str:
    apart = f"{one.difference_percent:.1f} {inquiry.model.error_unit}"
    name, *rivals = one.contest.names
    if rivals:
        return f"the two predict paths that lie {apart} apart on average"
    if name == "unknown":
        return f"the missing force, as it was fitted, moves this {wording.trial} by {apart}"
    text = inquiry.model.effects[name].text
    if one.contest.rival is not None:
        return f"{text}: with it the model predicts a path {apart} away on average"
    return f"{text}: a little of it moves this {wording.trial} by {apart}"


def confusion_set(found: Found, near: Sequence[Rung]) -> list[list[str]]:
    """Return the sets of effects that the trials cannot tell apart, the best one first.

    Parameters
    ----------
    near : refits that came near to being named.
    """
    on_ladder = [name for rung in found.ladder[1:] for name in rung.revision.effects[-1:]]
    named = [[name, *found.rivals[name]] for name in on_ladder if found.rivals.get(name)]
    return [*named, added(near)] if len(near) > 1 else named
