"""The verdict: one rule, as docs/decision.md states it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from robotcast.diagnosis.found import Effects, Found, Rung
from robotcast.diagnosis.inquiry import Inquiry, Revision, held_out
from robotcast.diagnosis.library import Beginnings, Library
from robotcast.diagnosis.rule import Effort
from robotcast.fitting.least_squares import Fit


@dataclass(frozen=True)
class Unexplained:
    """What is left above the floor, and the field that explains most of it."""

    # its name among the model's effects, None when there are no fields to try
    field: str | None = None
    rung: Rung | None = None  # the model with it
    enough: bool = False  # whether it takes away so much that what is missing must be like it
    tried: int = 1  # how many fields were looked at


def look_for_the_unknown(
    inquiry: Inquiry,
    found: Found,
    fields: Sequence[str],
    effort: Effort,
    tell: Callable[[str], object],
) -> Unexplained:
    """Fit the likeliest fields on top of the base model with the same effort as effects.

    Those that promise to do better than the chosen effects, by what they miss of the beginnings
    and what their parameters cost, are fitted to all trials; by the same the best one is taken.
    """
    if not fields:
        return Unexplained()
    base, early = found.base.effects, inquiry.beginnings(effort.early, effort.some)
    scales = found.known_scales
    begun = Beginnings(early, scales.floor, scales.rule, effort)
    tell("every field")
    tuned = early.fit(base, found.base.revision.fit.vector, 0)
    together = _fields_together(early, base, tuned, fields)
    for effects in together.best(1, min(effort.finalists + 1, len(fields)), base):
        tell(inquiry.model.effects[effects[-1]].text)
        null = early.carried(effects, base, tuned.vector)
        for start in (together.start(effects), early.guessed(effects, null, effects[-1:])):
            if start is not None:
                known = together.look(effects, start)
                begun.fit(effects, known.vector, known)
    least = early.expected_loss(found.chosen, found.early[found.chosen])
    cost = {effects: early.expected_loss(effects, fit) for effects, fit in begun.fits.items()}
    hopeful = sorted((e for e in cost if cost[e] <= least), key=cost.__getitem__)
    revisions = []
    for effects in hopeful[: effort.finalists]:
        tell(inquiry.model.effects[effects[-1]].text)
        whole = inquiry.fit_whole(effects, begun.begun(effects), effort.refit)
        revisions.append(Revision(effects, whole))
    if not revisions:
        return Unexplained()
    best = min(revisions, key=lambda one: inquiry.expected_loss(one.effects, one.fit))
    rung = Rung(best, held_out(inquiry, best, effort))
    enough = found.gain(found.base, rung).pays(scales.rule, len(fields)) and found.predicts(rung)
    return Unexplained(best.effects[-1], rung, enough, len(fields))


def _fields_together(early: Inquiry, base: Effects, fit: Fit, fields: Sequence[str]) -> Library:
    """Return all fields beside each other, each known by its slopes where it does nothing."""
    parts = [fit.jacobian]
    for name in fields:
        effects = (*base, name)
        null = early.carried(effects, base, fit.vector)
        steps = early.steps(effects)[len(fit.vector) :]
        rows = null + np.hstack([np.zeros((len(steps), len(fit.vector))), np.diag(steps)])
        moved = early.residuals(effects)(rows, early.everything) - fit.residual
        parts.append(np.moveaxis(moved / steps[:, None, None], 0, -1))
    everything = (*base, *fields)
    vector = early.carried(everything, base, fit.vector)
    whole = Fit(vector, fit.residual, np.concatenate(parts, axis=-1), fit.jitter)
    return Library(early, everything, whole)


def strengths(inquiry: Inquiry, found: Unexplained) -> np.ndarray:
    """Return the field's fitted strengths."""
    assert found.field is not None and found.rung is not None
    n = len(inquiry.model.effects[found.field].parameters)
    return inquiry.values(found.rung.effects, found.rung.revision.fit.vector)[0, -n:]


class Code(Enum):
    """What a verdict says; `OPEN` until there is one."""

    OPEN = ""
    NONE = "none"
    NAMED = "named"
    UNKNOWN = "unknown"
    CANNOT_TELL = "cannot tell"


@dataclass(frozen=True)
class Verdict:
    """What is missing."""

    code: Code = Code.OPEN
    named: tuple[str, ...] = ()  # the effects that are, when the code says so
    near: tuple[Rung, ...] = ()  # models that promise to predict better, unconfirmed; best first
    # what stays above the floor and what it is like; None where nothing does
    left: Unexplained | None = None

    @property
    def alike(self) -> list[str]:
        """What the near models are called: by their effects that not all of them have."""
        sets = [rung.effects for rung in self.near]
        shared = set(sets[0]).intersection(*sets[1:]) if sets else set[str]()
        return [" + ".join(n for n in one if n not in shared) or one[-1] for one in sets]

    @property
    def words(self) -> list[str]:
        """The verdict as `diagnosis.json` has it: effect ids, or "none", or "unknown"."""
        if self.named or self.code is Code.OPEN:
            return list(self.named)
        return ["unknown" if self.code is Code.UNKNOWN else "none"]


def decide(
    found: Found, look: Callable[[], Unexplained], refit: Callable[[np.ndarray], Found]
) -> Verdict:
    """Decide what a search found.

    `look` looks for the force of no name that the base model lacks. `refit` judges single effects
    too, where a field has shown that something is missing, from the unit vector (n,) of the model's
    parameters beside it.
    """
    floor, rule = found.known_scales.floor, found.known_scales.rule
    named, near = found.named, found.near
    if not named and floor.percent is None:
        return Verdict(Code.CANNOT_TELL, (), near)
    if not found.above(found.top, 1 + rule.material) and not found.inseparable:
        return Verdict(Code.NAMED, named) if named else Verdict(Code.NONE, (), near)
    left = look()
    if found.inseparable:
        return Verdict(Code.UNKNOWN, (), _best(found), left)
    imitated = bool(named) and _imitates(found, left)
    if named and not imitated:
        larger = [rung for rung in near if set(found.chosen) < set(rung.effects)]
        fewest = min((len(rung.effects) for rung in larger), default=0)
        return _named(found, tuple(rung for rung in larger if len(rung.effects) == fewest))
    if imitated:
        near = _best(found)
    if left.enough:
        assert left.rung is not None
        own = len(found.base.revision.fit.vector)
        more = refit(left.rung.revision.fit.vector[:own])
        known = _name_for(more, left)
        if known:
            return _named(known)
        near = near if imitated else more.near
    far, unfinished = (found.above(found.base, times) for times in (rule.beyond, rule.at_floor))
    shown = left.enough if far else unfinished and _is_like_it(found, left)
    if shown or (far and (imitated or not floor.is_least)):
        return Verdict(Code.UNKNOWN, (), near, left)
    if far:  # above the sensors' noise, and repeats may differ by as much
        return Verdict(Code.CANNOT_TELL, (), near, left)
    lacks = unfinished or imitated or left.enough
    return Verdict(Code.NONE, (), near, Unexplained() if lacks else None)


def _named(found: Found, near: tuple[Rung, ...] = ()) -> Verdict:
    """Name the chosen effects, and say whether more is missing."""
    return Verdict(Code.NAMED, found.named, near, Unexplained() if _unfinished(found) else None)


def _unfinished(found: Found) -> bool:
    """Tell whether the chosen model stays above the floor.

    What is a little above the sensors' noise alone may vary from run to run.
    """
    rule, floor = found.known_scales.rule, found.known_scales.floor
    return found.above(found.top, rule.beyond if floor.is_least else rule.at_floor)


def _name_for(found: Found, left: Unexplained) -> Found | None:
    """Return what was found with the effects chosen that do as well as a field that pays.

    The field proves that something is missing, so that they need only be likely to help, and
    come as near to the floor as an honest model does, or do what the field does with fewer numbers.
    """
    rule, likely = found.known_scales.rule, []
    for rung in found.judged.values():
        gain = found.gain(found.base, rung)
        if found.predicts(rung) and gain.matters(rule, rule.mostly) and gain.p_value < rule.equal:
            likely.append((len(rung.effects), found.typical(rung), rung.effects))
    if not likely:
        return None
    known = replace(found, chosen=min(likely)[2])
    if _is_same(known, left) and _is_like_it(found, left):
        return known
    return None if known.above(known.top, rule.beyond) or _imitates(known, left) else known


def _is_same(found: Found, left: Unexplained) -> bool:
    """Tell whether a field, as it was fitted, predicts what the chosen effects do.

    So it is where the two differ by less than matters of what the field explains.
    """
    assert left.rung is not None
    before, own, field = (r.revision.fit.residual for r in (found.base, found.top, left.rung))
    apart, moved = (float(((one - field) ** 2).sum()) for one in (own, before))
    return apart < found.known_scales.rule.material**2 * moved


def _is_like_it(found: Found, left: Unexplained) -> bool:
    """Tell whether a field that pays explains most of what is missing.

    It does where it comes down to the floor, or takes away more than half of what lies beyond it;
    a smaller part may be what honest models differ by.
    """
    if not left.enough:
        return False
    assert left.rung is not None
    rule = found.known_scales.rule
    at_floor = not found.above(left.rung, rule.at_floor)
    return at_floor or found.gain(found.base, left.rung).rest > rule.mostly


def _imitates(found: Found, left: Unexplained) -> bool:
    """Tell whether the chosen effects only imitate what is missing.

    They do where a field alone takes away most of what they leave above the floor (at it, honest
    models may differ by as much: there it must be half of what matters), or where they stay above
    it and take away less than half of what they could: of what the base model misses beyond the
    floor, or beyond what a field that pays leaves and honest models may differ by.
    """
    rule, reach = found.known_scales.rule, found.known_scales.floor.reach
    before, after = found.typical(found.base), found.typical(found.top)
    if left.rung is not None:
        beside, gain = found.typical(left.rung), found.gain(found.top, left.rung)
        refuted = after - beside > rule.mostly * (after - reach)
        if refuted and gain.matters(rule, rule.mostly) and gain.p_value < rule.level / left.tried:
            return True
        if left.enough:
            reach = float(np.clip(beside, reach, rule.beyond * reach))
    return _unfinished(found) and before - after < rule.mostly * (before - reach)


def _best(found: Found) -> tuple[Rung, ...]:
    """Return the judged model with effects that predicts best."""
    others = [rung for rung in found.judged.values() if rung is not found.base]
    return (min(others, key=found.typical),)
