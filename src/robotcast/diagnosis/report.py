"""What a diagnosis says, as plain data for `diagnosis.json` and its page."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from robotcast.diagnosis.decision import Code, Unexplained, Verdict
from robotcast.diagnosis.found import Found, Rung
from robotcast.diagnosis.inquiry import Inquiry, Revision
from robotcast.diagnosis.limits import counted, is_ignored
from robotcast.diagnosis.misfit import known_median
from robotcast.diagnosis.model import Wording
from robotcast.diagnosis.next_trials import MOST_RIVALS, NextTrial
from robotcast.diagnosis.rule import Rule
from robotcast.diagnosis.screen import Screened
from robotcast.diagnosis.sizes import sizes

UNTOUCHED = ("ignored by the model", "touches nothing")  # nothing that is computed says anything


def sentence(inquiry: Inquiry, found: Found, verdict: Verdict, wording: Wording, where: str) -> str:
    """Say the verdict in a sentence, and in others how far the error stays above noise, and why.

    Errors are those of the trial in the middle, wrongly measured ones left out. `where` is the
    slice of the last model's error that holds most of it; empty when none stands out.
    """
    usual, floor = found.known_scales.usual, found.known_scales.floor
    before, after = (float(np.median(r.errors.waypoint[usual])) for r in (found.base, found.top))
    unit, trials = inquiry.model.error_unit, wording.trials
    times = _times(found, after, wording)
    near = _nearest(inquiry, found, verdict, wording)
    if verdict.code is Code.UNKNOWN:
        said = _unknown(inquiry, found, verdict, before, times, where, wording)
    elif verdict.named:
        names = " and ".join(inquiry.model.effects[name].text for name in verdict.named)
        said = (
            f"The model lacks this: {names}. With it the typical error on held-out {trials} falls "
            f"from {before:.2f} to {after:.2f} {unit}."
        )
        if verdict.left is not None:
            more = f"so more is missing{_most(where)}"
            said += f" That is still {times}, {more}."
        said += _confused(inquiry, found, verdict, wording)
    else:
        beside = f", where {wording.floor} {floor.percent:.2f}" if floor.percent else ""
        said = (
            "No effect of the library is confirmed: the typical error on held-out "
            f"{trials} stays at {before:.2f} {unit}{beside}."
            f"{_left(found, verdict, times, where, wording, unit)}"
        )
    return f"{said}{near}{_blunders(usual, wording)}"


def _confused(inquiry: Inquiry, found: Found, verdict: Verdict, wording: Wording) -> str:
    """Say what could stand in the place of what is named."""
    said, effects = "", inquiry.model.effects
    for name in verdict.named:
        rivals = found.rivals.get(name, ())
        texts = " or ".join(effects[one].text for one in rivals[:MOST_RIVALS])
        more = f", or {len(rivals) - MOST_RIVALS} more" if len(rivals) > MOST_RIVALS else ""
        own = "it" if len(verdict.named) == 1 else effects[name].text
        said += f" These {wording.trials} hardly tell {own} from this: {texts}{more}." * bool(
            rivals
        )
    return said


def _times(found: Found, middle: float, wording: Wording) -> str:
    """Say how far above the floor the chosen model is, in the trial in the middle and over all."""
    floor = found.known_scales.floor
    if not floor.percent:
        return ""
    whole, own = found.typical(found.top) / floor.reach, middle / floor.percent
    times = f"{own:.1f} times what {wording.floor}"
    if own > found.known_scales.rule.at_floor or whole < own:
        return times
    return f"{times} in the {wording.trial} in the middle, and {whole:.1f} times over all"


def _left(
    found: Found, verdict: Verdict, times: str, where: str, wording: Wording, unit: str
) -> str:
    if verdict.code is Code.CANNOT_TELL:
        if not times:
            return " Nothing was repeated, so nobody can say how much of it is noise."
        if not found.predicts(found.base):
            assert found.idle is not None
            error = f"{np.median(found.idle[found.known_scales.usual]):.2f} {unit}"
            return f" {wording.idle} miss {error}, and nothing is named that misses more than half."
        beside = "how much of it differs from run to run, repeats would tell"
        return f" That is {times}{_most(where)}. Nothing that was tried explains it; {beside}."
    if verdict.left is None:
        return ""
    return f" That is {times}{_most(where)}, and nothing that was tried explains it."


def _unknown(
    inquiry: Inquiry,
    found: Found,
    verdict: Verdict,
    error: float,
    times: str,
    where: str,
    wording: Wording,
) -> str:
    said = "Something is missing that the library does not hold:"
    left, effects = verdict.left, inquiry.model.effects
    if left is not None and left.field is not None and left.enough:
        assert left.rung is not None
        after = float(np.median(left.rung.errors.waypoint[found.known_scales.usual]))
        return (
            f"{said} {effects[left.field].text}. With a curve fitted to it the typical error on "
            f"held-out {wording.trials} falls from {error:.2f} to {after:.2f} "
            f"{inquiry.model.error_unit}."
        )
    stays = (
        f"{said} the typical error on held-out {wording.trials} stays at {error:.2f} "
        f"{inquiry.model.error_unit}, {times}{_most(where)}."
    )
    if left is None or left.field is None:
        return stays
    return f"{stays} What comes nearest is {effects[left.field].text}."


def _most(where: str) -> str:
    if not where:
        return ""
    placed = where.startswith(("in ", "on "))
    return f", most of it {where}" if placed else f", most of it at {where}"


def _blunders(usual: np.ndarray, wording: Wording) -> str:
    n = int((~usual).sum())
    if not n:
        return ""
    wrong = "was measured wrongly and is" if n == 1 else "were measured wrongly and are"
    return f" {counted(n, wording.trial, wording.trials)} of {len(usual)} {wrong} left out."


def _nearest(inquiry: Inquiry, found: Found, verdict: Verdict, wording: Wording) -> str:
    if not verdict.near:
        return ""
    texts = " or ".join(
        " and ".join(inquiry.model.effects[n].text for n in rung.effects if n not in found.chosen)
        for rung in verdict.near
    )
    error = float(np.median(verdict.near[0].errors.waypoint[found.known_scales.usual]))
    percent = f"{error:.2f} {inquiry.model.error_unit}"
    if verdict.code is Code.UNKNOWN:
        nearest = f" Of the effects with a name this comes nearest: {texts}, with {percent}"
        return f"{nearest}, not enough to name it."
    if verdict.named:
        return f" It may be this too: {texts}; with it the error would be {percent}."
    return f" It may be this: {texts}. With it the error is {percent}, not enough to name it."


def sentence_on_too_few(inquiry: Inquiry, wording: Wording, rule: Rule) -> str:
    """Say in one sentence that the trials confirm nothing."""
    n, groups = len(inquiry.records), int(inquiry.groups.max()) + 1
    return (
        f"{counted(n, wording.trial, wording.trials)} of "
        f"{counted(groups, wording.group, wording.groups)} "
        f"{'is' if n == 1 else 'are'} too few to tell whether an effect is missing; "
        f"{rule.fewest_groups} different {wording.groups} are the least."
    )


def unexplained(
    inquiry: Inquiry,
    left: Unexplained | None,
    draw: Callable[[Inquiry, Unexplained], Mapping[str, Any] | None],
) -> dict[str, Any] | None:
    """Return what the missing force depends on, drawn by `draw`; None when nothing is left."""
    if left is None:
        return None
    if left.field is None or left.rung is None:
        return {
            "depends_on": None,
            "explains": False,
            "text": "What is left above the noise floor has no name here.",
            "heldout_typical_error_percent": None,
            "heldout_waypoint_error_percent": None,
            "field": None,
        }
    field = inquiry.model.effects[left.field]
    like = "What is missing acts like" if left.enough else "Nothing explains it. Nearest comes"
    return {
        "depends_on": field.depends_on,
        "explains": left.enough,
        "text": f"{like} {field.text}.",
        "heldout_typical_error_percent": float(np.median(left.rung.errors.waypoint)),
        "heldout_waypoint_error_percent": float(left.rung.errors.waypoint.mean()),
        "field": draw(inquiry, left),
    }


def ladder(found: Found) -> list[dict[str, Any]]:
    """Return the rungs of the error ladder."""
    return [_rung(rung, found.known_scales.usual) for rung in found.ladder]


def _rung(rung: Rung, usual: np.ndarray) -> dict[str, Any]:
    errors = rung.errors.waypoint
    return {
        "effects": list(rung.effects),
        "heldout_typical_error_percent": float(np.median(errors[usual])),
        "heldout_waypoint_error_percent": float(errors.mean()),
        "heldout_final_error_percent": known_median(rung.errors.final),
        "standard_error_percent": _error_of_middle(errors[usual]),
        "p_value": rung.gain.p_value if rung.gain else None,
    }


def _error_of_middle(errors: np.ndarray) -> float:
    """Return the standard error of the median, as for errors that scatter normally about it."""
    scatter = 1.4826 * np.median(np.abs(errors - np.median(errors)))
    return float(np.sqrt(np.pi / 2) * scatter / np.sqrt(len(errors)))


def fitted(inquiry: Inquiry, revision: Revision, vectors: np.ndarray, rule: Rule) -> dict[str, Any]:
    """Return the parameters of a fitted model by name, those of its effects with their effect."""
    own = sizes(inquiry, revision, vectors, rule.discrepancy)
    names = [p.name for p in inquiry.model.parameters]
    names += [
        f"{e}.{p.name.rpartition('.')[2]}"
        for e in revision.effects
        for p in inquiry.model.effects[e].parameters
    ]
    return {
        "effects": list(revision.effects),
        "parameters": {name: size.as_dict() for name, size in zip(names, own, strict=True)},
    }


def ranking(
    inquiry: Inquiry,
    found: Found,
    screens: Mapping[str, Screened],
    verdict: Verdict,
    rule: Rule,
    slices: Mapping[str, list[dict[str, Any]]],
) -> list[dict[str, Any]]:
    """Return every effect that was tried, the most promising first.

    Effects that cannot be judged stand last, each with the reason. `slices` has for every judged
    effect the slices of the error before and after it.
    """
    rows = []
    for name, one in screens.items():
        rung = _judged(found, name)
        row = _row(inquiry, found, verdict, one, rung, rule)
        row["slices"] = slices.get(name, [])
        order = (
            one.status is not None and rung is None,
            name not in verdict.named,
            rung is None,
            one.predicted,
        )
        rows.append((order, row))
    return [row for _, row in sorted(rows, key=lambda pair: pair[0])]


def _judged(found: Found, name: str) -> Rung | None:
    """Return the judged model that tells most of an effect: the chosen one, or the best with it."""
    if name in found.chosen:
        return found.top
    with_it = [r for e, r in found.judged.items() if name in e[len(found.base.effects) :]]
    return min(with_it, key=lambda r: float(r.errors.waypoint.mean()), default=None)


def unjudged(inquiry: Inquiry, name: str, status: str) -> dict[str, Any]:
    """Return the row of an effect of which nothing but its status is known."""
    nothing = ("predicted_typical_error_percent", "realised_typical_error_percent", "power")
    return {
        "effect": name,
        "text": inquiry.model.effects[name].text,
        "p_value": None,
        "parameters": {},
        **dict.fromkeys(nothing),
        "confusable_with": [],
        "status": status,
        "slices": [],
    }


def _row(
    inquiry: Inquiry,
    found: Found,
    verdict: Verdict,
    one: Screened,
    rung: Rung | None,
    rule: Rule,
) -> dict[str, Any]:
    name = one.effect
    tried = any(name in effects for effects in found.early)
    status = one.status or ("tried" if tried else "screened")
    if rung is not None:
        status = "confirmed" if name in verdict.named else "refitted"
    row, alike = unjudged(inquiry, name, status), _near_names(verdict)
    row["confusable_with"] = [
        *found.rivals.get(name, ()),
        *(e for e, rivals in found.rivals.items() if name in rivals),
        *(e for e in alike if e != name and name in alike),
    ]
    if status not in UNTOUCHED:
        p_value = rung.gain.p_value if rung and rung.gain else one.p_value
        row |= {"p_value": p_value, "power": one.power}
        row["predicted_typical_error_percent"] = one.predicted
    if rung is not None:
        own = sizes(inquiry, rung.revision, rung.errors.vectors, rule.discrepancy)
        own = own[inquiry.entries(rung.effects, name)]
        row["parameters"] = {size.parameter.name: size.as_dict() for size in own}
        row["realised_typical_error_percent"] = float(np.median(rung.errors.waypoint))
    return row


def base_parameters(
    inquiry: Inquiry, base: Revision, vectors: np.ndarray | None, rule: Rule
) -> dict[str, Any]:
    """Return the sizes of the base model's parameters.

    One that changes nothing may be any; one that is held has no interval. The `vectors` (k, n) are
    those of the folds' fits, None when there were none.
    """
    own = sizes(inquiry, base, vectors, rule.discrepancy)[: len(inquiry.model.parameters)]
    rows = {}
    for k, size in enumerate(own):
        parameter = size.parameter
        row = rows[parameter.name] = size.as_dict()
        if parameter.frozen:
            row |= {"low": None, "high": None}
        elif is_ignored(base, k, rule):
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
    text = " and ".join(inquiry.model.effects[some].text for some in name.split(" + "))
    if one.contest.rival is not None:
        return f"{text}: with that the model predicts a path {apart} away on average"
    return f"{text}: a little of it moves this {wording.trial} by {apart}"


def _near_names(verdict: Verdict) -> list[str]:
    return list(dict.fromkeys(name for one in verdict.alike for name in one.split(" + ")))


def confusion_set(found: Found, verdict: Verdict) -> list[list[str]]:
    """Return the sets of effects that the trials cannot tell apart, the best one first."""
    if verdict.code is Code.UNKNOWN:
        return []
    named = [[name, *found.rivals[name]] for name in verdict.named if found.rivals.get(name)]
    return [*named, _near_names(verdict)] if len(verdict.near) > 1 else named
