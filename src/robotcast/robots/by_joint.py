"""The diagnosis of a robot: groups of joints first, then single joints."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from robotcast.diagnosis.decision import Unexplained
from robotcast.diagnosis.diagnose import Case, Tell, diagnose, floor_and_noise
from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.library import library_at
from robotcast.diagnosis.report import unexplained
from robotcast.robots.effect import RobotEffect
from robotcast.robots.robot_case import RobotCase, draw_field
from robotcast.running import Progress, silent

LOOKED_INTO = 20  # effects of single joints and links that are tried at once
BETTER = 2.0  # times as long windows, or as low a floor, by which it pays to ask again


def diagnose_robot(
    case: RobotCase, ask: Callable[[RobotCase], Case], tell: Tell, progress: Progress = silent
) -> tuple[RobotCase, dict[str, Any]]:
    """Diagnose a robot, and once more where windows and floor are better by the model found.

    That counts where it names the same, or what it cannot tell from it, or more beside it; else it
    is only noted. Return the case that counts, and what was found, with its notes.
    """

    def told(found: dict[str, Any]) -> dict[str, Any]:
        joined = {**found, "notes": [*case.notes, *found["notes"]]}
        tell(joined)
        return joined

    first, question = case, ask(case)
    found = diagnose_by_joint(case, question, told, progress)
    about = case.about(found) if found["code"] == "named" else None
    if about and _tells_more(about, ask(about), case, question, found):
        case = about
        again = diagnose_by_joint(case, ask(case), told, progress)
        alike = [{*group} for group in again["confusion_set"] if {*group} & {*again["verdict"]}]
        as_many = len(found["verdict"]) <= len(again["verdict"])
        if as_many and {*found["verdict"]} <= {*again["verdict"]}.union(*alike):
            return case, told(again)
        other = (
            f"Asked once more with windows of {case.length_s:.2g} s, as long as the model found "
            f"predicts, it says something else: {again['sentence']}"
        )
        case, found = first, {**found, "notes": [other, *found["notes"]]}
    return case, told(found)


def diagnose_by_joint(
    case: RobotCase, question: Case, tell: Tell, progress: Progress = silent
) -> dict[str, Any]:
    """Diagnose a robot, groups of joints first; then, where something is missing, single joints.

    Where an effect of a whole group is named, it competes with those of its joints and their
    special cases: it is as simple as one of them, and stays where all joints have it. What else was
    named is tried beside them. For as long as more is missing and named, of the effects of all
    single joints and links those are tried beside it that the slopes promise most of, and fields of
    single joints. Where the whole is at its floor and some signals are not, they are looked at so.
    """
    found, ask = diagnose(question, tell, progress), partial(_ask_again, [], tell, progress)
    effects, single = case.model.effects, _of_single_joints(case, question)
    laws = [n for n, e in single.items() if e.depends_on is None]
    named = [n for n in found["verdict"] if n in effects]
    if own := [n for n in laws if any(_same(single[n], effects[name]) for name in named)]:
        effects.update({n: single[n] for n in laws})
        why = f"First, of a group: {' + '.join(named)}. Then its joints were told apart."
        cases = Inquiry(case.model, question.records, 1.0).special_cases
        own += [one for n in own for one in cases(n, laws)]
        effects.update(some := _those_that_have_it(found, effects))
        own += some
        asked = replace(question, candidates=list(dict.fromkeys([*named, *own])))
        found = ask(asked, found, why)
    while laws and _unfinished(question, found):
        effects.update(single)
        named = [n for n in found["verdict"] if n in effects]
        why = f"Too little was explained by {' + '.join(named) or 'what all joints may lack'}"
        found = _look_at(case, question, found, laws, why, ask)
        if found["code"] != "named" or len(found["verdict"]) <= len(named):
            break
    some, standing = _standing_out(case, question, found)
    if some.any() and not some.all():
        effects.update(single)
        why = f"{standing}: that counts here as much as all other signals together"
        weighed, laws = case.weighing(some), [*laws, *question.candidates]
        question, ask = weighed.ask(question), partial(ask, weighed=True)
        found = _look_at(weighed, question, found, laws, why, ask)
        some, standing = _standing_out(case, question, found)
    if some.any() and not found["unexplained"]:
        left = unexplained(Inquiry(case.model, question.records, 1.0), Unexplained(), draw_field)
        sentence = f"{found['sentence']} But {standing}."
        found = {**found, "unexplained": left, "sentence": sentence}
        tell(found)
    return found


def _tells_more(
    about: RobotCase, asked: Case, case: RobotCase, question: Case, found: Mapping[str, Any]
) -> bool:
    """Tell whether a model that was found gives so much longer windows or so low a floor.

    A lower floor tells nothing more where it stands at that, too, and is confused with no other.
    """
    (floor, _), (before, _) = floor_and_noise(asked), floor_and_noise(question)
    longer, lower = about.length_s / case.length_s, before.reach / floor.reach
    left, rule = about.model.usual_miss(about.model.nominal_misses), question.rule
    above = left > rule.at_floor * floor.reach
    to_tell = above and not _unfinished(question, found)
    to_tell |= lower >= BETTER and (above or bool(found["confusion_set"]))
    return longer >= 1 and (longer >= BETTER or to_tell)


def _those_that_have_it(
    found: Mapping[str, Any], effects: Mapping[str, RobotEffect]
) -> dict[str, RobotEffect]:
    """Return by name what was named of another size in each joint, for those that have it."""
    sizes, some = found["model"].get("parameters", {}), {}
    for one in [effects[n] for n in found["verdict"] if n in effects and effects[n].where.each]:
        known = [sizes[f"{one.name}.{p.name}"] for p in one.parameters]
        pairs = zip(one.where.dofs, known, strict=True)
        sure = [dof for dof, p in pairs if not p["low"] <= p["null"] <= p["high"]]
        if 1 < len(sure) < len(known):
            less = one.of_joints(sure)
            some[less.name] = less
    return some


def _same(one: RobotEffect, other: RobotEffect) -> bool:
    """Tell whether two effects do the same to a group and to a part of it, or to each joint."""
    return one.is_part_of(other) or other.is_part_of(one)


def _of_single_joints(case: RobotCase, question: Case) -> dict[str, RobotEffect]:
    """Return effects and fields of single joints, links and drives, but of what was left out."""
    effects, tried = case.model.effects, question.candidates
    left_out = [
        e
        for n, e in effects.items()
        if n not in tried and e.depends_on is None
        if not any(effects[other].is_part_of(e) for other in tried)
    ]
    others = {n: e for n, e in case.of_single_parts.items() if n not in effects}
    return {n: e for n, e in others.items() if not any(_same(e, one) for one in left_out)}


def _look_at(
    case: RobotCase,
    question: Case,
    found: dict[str, Any],
    laws: Sequence[str],
    why: str,
    ask: Callable[[Case, dict[str, Any], str], dict[str, Any]],
) -> dict[str, Any]:
    """Try what promises most of some effects beside those that are named."""
    effects = case.model.effects
    named = [n for n in found["verdict"] if n in effects]
    others = [n for n in laws if n not in named]
    if not others or len(named) == question.rule.most_effects:
        return found
    among = (n for n in dict.fromkeys([*others, *question.candidates]) if n not in named)
    parts = [n for n in among if any(effects[n].is_part_of(effects[name]) for name in named)]
    promising = _promising(case, question, found, named, others)
    promising += [n for n in parts if n not in promising]
    why += (
        f", so of {len(others)} effects of single joints and links {len(promising)} were tried: "
        "those that promise most, their special cases, and what a named group may come down to."
    )
    comparisons = len(named) + len(others)
    asked = replace(question, candidates=[*named, *promising], comparisons=comparisons)
    return ask(asked, found, why)


def _standing_out(
    case: RobotCase, question: Case, found: Mapping[str, Any]
) -> tuple[np.ndarray, str]:
    """Return which signals (n_signals,) are above their floor, more than is honest; and say so.

    Of many signals at their floor, one that is not would hardly be seen.
    """
    rule, code = question.rule, found["code"]
    times = case.times_floor(found, rule.least_noise)
    least = rule.beyond if code == "named" and question.floor_is_least else rule.at_floor
    some = (times > least) & (code in ("none", "named"))
    pairs = zip(case.wording.axes, times, some, strict=True)
    told = " and ".join(f"{axis.name} at {by:.1f}" for axis, by, own in pairs if own)
    return some, f"{told.replace(' at ', ' is at ', 1)} times what {case.wording.floor}"


def _unfinished(question: Case, found: Mapping[str, Any]) -> bool:
    """Tell whether a diagnosis leaves more than noise in the window in the middle, or says so.

    That is asked of a named effect, too, which the verdict lets leave more.
    """
    if not found["conclusive"] or found["unexplained"] or found["code"] not in ("none", "named"):
        return found["conclusive"]
    left, floor = found["ladder"][-1]["heldout_typical_error_percent"], found["noise_floor_percent"]
    return left > question.rule.at_floor * floor


def _ask_again(
    said: list[str],
    tell: Tell,
    progress: Progress,
    question: Case,
    found: dict[str, Any],
    why: str,
    weighed: bool = False,
) -> dict[str, Any]:
    """Return another diagnosis if it names something else, or what is missing where nothing did.

    What it names must predict about as well as what was named before. Where signals are `weighed`
    otherwise, it stands where the whole named nothing, else it must keep what that named. It is
    `said` why each one that stands was asked for.
    """
    again = diagnose(question, tell, progress)
    rule, other = question.rule, {*again["verdict"]} != {*found["verdict"]}
    least, left = (one["ladder"][-1]["heldout_typical_error_percent"] for one in (found, again))
    least = max(least, rule.at_floor * found["noise_floor_percent"])
    was, now = ((one["unexplained"] or {}).get("explains", False) for one in (found, again))
    clearer = again["code"] == "unknown" and found["code"] != "named" and (other or now > was)
    better = again["code"] == "named" and other and left < (1 + rule.material) * least
    if weighed:
        clearer = found["code"] == "none"
        better = again["code"] == "named" and {*found["verdict"]} < {*again["verdict"]}
    if clearer or better:
        said.append(why)
        found = {**again, "notes": [*said, *again["notes"]]}
    tell(found)
    return found


def _promising(
    case: RobotCase,
    question: Case,
    found: dict[str, Any],
    named: Sequence[str],
    others: Sequence[str],
) -> list[str]:
    """Return which of the others promise most beside the model found, then their special cases."""
    effort, acting, own = question.effort, (*question.fixed, *named), case.model.parameters
    early = Inquiry(case.model, question.records, floor_and_noise(question)[1]).beginnings(
        effort.early, effort.some
    )
    known = (found["model"] or found["base"])["parameters"]
    names = [p.name for p in own]
    names += [f"{e}.{p.name}" for e in acting for p in case.model.effects[e].parameters]
    tuned = [
        float(p.to_unit(np.asarray(known[name]["value"] if name in known else p.nominal)))
        for name, p in zip(names, early.parameters(acting), strict=True)
    ]
    begun = early.fit(acting, np.array(tuned), 0)
    some = library_at(early, acting, others, begun).best(1, LOOKED_INTO, acting)
    best = [effects[-1] for effects in some]
    cases = (one for name in best for one in early.special_cases(name, others))
    return list(dict.fromkeys([*best, *cases]))
