"""The verdict: one rule, as docs/decision.md states it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from robotcast.diagnosis.errors import Floor
from robotcast.diagnosis.found import Effects, Found, Rung
from robotcast.diagnosis.inquiry import Inquiry, Revision, held_out
from robotcast.diagnosis.library import Library
from robotcast.diagnosis.rule import Effort, Rule
from robotcast.fitting.least_squares import Fit


@dataclass(frozen=True)
class Unexplained:
    """What is left above the floor, and the field that explains most of it.

    Attributes
    ----------
    field : its name among the model's effects, None when there are no fields to try.
    rung : the model with it.
    enough : whether the field takes away so much that what is missing must be like it.
    tried : how many fields were looked at.
    """

    field: str | None = None
    rung: Rung | None = None
    enough: bool = False
    tried: int = 1


def look_for_the_unknown(
    inquiry: Inquiry,
    found: Found,
    fields: Sequence[str],
    effort: Effort,
    rule: Rule,
    tell: Callable[[str], object],
) -> Unexplained:
    """Fit the likeliest fields on top of the base model: to beginnings, and the best one to all.

    What they miss of the beginnings, and what their parameters cost, decides between them, and
    whether the best one may do better than the chosen effects.
    """
    base, scales = found.base, found.scales
    if not fields or scales is None:
        return Unexplained()
    early, known = inquiry.beginnings(effort.early, effort.some), found.early[found.chosen]
    field, fit = _Contest(early, base.effects, found.early[base.effects], effort, tell).best(fields)
    effects = (*base.effects, field)
    if early.expected_loss(effects, fit) > early.expected_loss(found.chosen, known):
        return Unexplained()
    tell(inquiry.model.effects[field].text)
    revision = Revision(effects, inquiry.fit(effects, fit.vector, effort.refit, like=fit))
    rung = Rung(revision, held_out(inquiry, revision, effort))
    saved = scales.gain(base.errors.waypoint, rung.errors.waypoint)
    return Unexplained(field, rung, saved.pays(rule, len(fields)), len(fields))


@dataclass(frozen=True)
class _Contest:
    """Fits fields on top of a model that was fitted to the beginnings of some trials."""

    early: Inquiry
    effects: Effects
    fit: Fit
    effort: Effort
    tell: Callable[[str], object]

    def best(self, fields: Sequence[str]) -> tuple[str, Fit]:
        """Return the field that explains the beginnings best for its parameters, with its fit."""
        self.tell("every field")
        together = self._together(fields)
        sets = together.best(1, min(self.effort.finalists + 1, len(fields)), self.effects)
        judged = []
        for effects in sets:
            self.tell(self.early.model.effects[effects[-1]].text)
            vector, kept = together.start(effects)
            known = together.look(effects, vector, kept)
            fit = self.early.fit(effects, vector, self.effort.refit, known=known)
            cost = self.early.expected_loss(effects, fit)
            judged.append((cost, effects[-1], fit))
        _, field, fit = min(judged, key=lambda one: one[0])
        return field, fit

    def _together(self, fields: Sequence[str]) -> Library:
        """Return all fields beside each other, each known by its slopes where it does nothing."""
        early, fit = self.early, self.fit
        parts = [fit.jacobian]
        for name in fields:
            effects = (*self.effects, name)
            null = early.nominal(effects)
            null[: len(fit.vector)] = fit.vector
            steps = early.steps(effects)[len(fit.vector) :]
            rows = null + np.hstack([np.zeros((len(steps), len(fit.vector))), np.diag(steps)])
            moved = early.residuals(effects)(rows, early.everything) - fit.residual
            parts.append(np.moveaxis(moved / steps[:, None, None], 0, -1))
        everything = (*self.effects, *fields)
        vector = early.nominal(everything)
        vector[: len(fit.vector)] = fit.vector
        whole = Fit(vector, fit.residual, np.concatenate(parts, axis=-1))
        return Library(early, everything, whole)


def strengths(inquiry: Inquiry, found: Unexplained) -> np.ndarray:
    """Return the field's fitted strengths."""
    assert found.field is not None and found.rung is not None
    n = len(inquiry.model.effects[found.field].parameters)
    return inquiry.values(found.rung.effects, found.rung.revision.fit.vector)[0, -n:]


class Code(Enum):
    """What a verdict says."""

    NONE = "none"
    NAMED = "named"
    UNKNOWN = "unknown"
    CANNOT_TELL = "cannot tell"


@dataclass(frozen=True)
class Verdict:
    """What is missing.

    Attributes
    ----------
    named : the effects that are, when the code says so.
    near : models that promise to predict better, unconfirmed; the best first.
    left : what stays above the floor and what it is like; None where nothing does.
    """

    code: Code
    named: tuple[str, ...] = ()
    near: tuple[Rung, ...] = ()
    left: Unexplained | None = None

    @property
    def words(self) -> list[str]:
        """The verdict as `diagnosis.json` has it: effect ids, or "none", or "unknown"."""
        if self.named:
            return list(self.named)
        return ["unknown" if self.code is Code.UNKNOWN else "none"]


def decide(
    found: Found,
    floor: Floor,
    rule: Rule,
    look: Callable[[], Unexplained],
    refit: Callable[[np.ndarray], Found],
) -> Verdict:
    """Decide what a search found.

    Parameters
    ----------
    look : looks for the force of no name that the base model lacks.
    refit : judges single effects too, where a field has shown that something is missing, from
        the unit vector (n,) of the model's parameters beside it.
    """
    top, scales = found.top, found.scales
    assert scales is not None
    near = _near(found, rule)
    named = found.named
    if not named and floor.percent is None:
        return Verdict(Code.CANNOT_TELL, (), near)
    if not _worth_a_look(found, floor, rule) and not found.inseparable:
        code = Code.NAMED if named else Code.NONE
        return Verdict(code, named, () if named else near)
    left = look()
    # what is a little above the sensors' noise alone may vary from run to run
    enough = rule.beyond if floor.is_least else rule.at_floor
    if found.inseparable:
        return Verdict(Code.UNKNOWN, (), (_best(found),), left)
    imitated = bool(named) and _imitates(found, floor, left, rule)
    if named and not imitated:
        unfinished = floor.above(top.errors.waypoint[scales.usual], enough)
        larger = [rung for rung in near if set(top.effects) < set(rung.effects)]
        fewest = min((len(rung.effects) for rung in larger), default=0)
        more = tuple(rung for rung in larger if len(rung.effects) == fewest)
        return Verdict(Code.NAMED, named, more, Unexplained() if unfinished else None)
    far, unfinished = (
        floor.above(found.base.errors.waypoint[scales.usual], times)
        for times in (rule.beyond, rule.at_floor)
    )
    if imitated:
        near = (_best(found),)
    if left.enough:
        assert left.rung is not None
        own = len(found.base.revision.fit.vector)
        more = refit(left.rung.revision.fit.vector[:own])
        known = _name_for(more, floor, left, rule)
        if known:
            unfinished = floor.above(known.top.errors.waypoint[scales.usual], enough)
            return Verdict(Code.NAMED, known.named, (), Unexplained() if unfinished else None)
        near = near if imitated else _near(more, rule)
    shown = left.enough if far else unfinished and _is_like_it(found, floor, left, rule)
    if shown or (far and (imitated or not floor.is_least)):
        return Verdict(Code.UNKNOWN, (), near, left)
    if far:  # above the sensors' noise, and repeats may differ by as much
        return Verdict(Code.CANNOT_TELL, (), near, left)
    lacks = unfinished or imitated or left.enough
    return Verdict(Code.NONE, (), near, Unexplained() if lacks else None)


def _name_for(found: Found, floor: Floor, left: Unexplained, rule: Rule) -> Found | None:
    """Return what was found with the effects chosen that do as well as a field that pays.

    The field proves that something is missing, so that they need only be likely to help, and
    come as near to the floor as an honest model does.
    """
    scales, base = found.scales, found.base.errors.waypoint
    assert scales is not None
    likely = []
    for rung in found.judged.values():
        gain = scales.gain(base, rung.errors.waypoint)
        if gain.matters(rule, rule.mostly) and gain.p_value < rule.equal:
            likely.append((len(rung.effects), scales.typical(rung.errors.waypoint), rung.effects))
    if not likely:
        return None
    known = replace(found, chosen=min(likely)[2])
    far = floor.above(known.top.errors.waypoint[scales.usual], rule.beyond)
    return None if far or _imitates(known, floor, left, rule) else known


def _is_like_it(found: Found, floor: Floor, left: Unexplained, rule: Rule) -> bool:
    """Tell whether a field that pays explains most of what is missing.

    It does where it comes down to the floor, or takes away more than half of what lies beyond it;
    a smaller part may be what honest models differ by.
    """
    if not left.enough:
        return False
    assert found.scales is not None and left.rung is not None
    errors = left.rung.errors.waypoint
    saved = found.scales.gain(found.base.errors.waypoint, errors)
    at_floor = not floor.above(errors[found.scales.usual], rule.at_floor)
    return at_floor or saved.rest > rule.mostly


def _imitates(found: Found, floor: Floor, left: Unexplained, rule: Rule) -> bool:
    """Tell whether the chosen effects only imitate what is missing.

    They do where a field alone takes away most of what they leave above the floor (at it, honest
    models may differ by as much: there it must be half of what matters), or where they stay above
    it and take away less than half of what they could: of what the base model misses beyond the
    floor, or beyond what a field that pays leaves and honest models may differ by.
    """
    scales = found.scales
    assert scales is not None
    top, base = found.top.errors.waypoint, found.base.errors.waypoint
    before, after, reach = scales.typical(base), scales.typical(top), floor.reach
    if left.rung is not None:
        beside = scales.typical(left.rung.errors.waypoint)
        gain = scales.gain(top, left.rung.errors.waypoint)
        refuted = after - beside > rule.mostly * (after - reach)
        if refuted and gain.matters(rule, rule.mostly) and gain.p_value < rule.level / left.tried:
            return True
        if left.enough:
            reach = float(np.clip(beside, reach, rule.beyond * reach))
    enough = rule.beyond if floor.is_least else rule.at_floor
    unfinished = floor.above(top[scales.usual], enough)
    return unfinished and before - after < rule.mostly * (before - reach)


def _worth_a_look(found: Found, floor: Floor, rule: Rule) -> bool:
    """Tell whether the model misses more than repeats differ by, by what would matter."""
    scales, errors = found.scales, found.top.errors.waypoint
    assert scales is not None
    return floor.above(errors[scales.usual], 1 + rule.material)


def _best(found: Found) -> Rung:
    """Return the judged model with effects that predicts best."""
    assert found.scales is not None
    typical = found.scales.typical
    some = [rung for rung in found.judged.values() if rung is not found.base]
    return min(some, key=lambda rung: typical(rung.errors.waypoint))


def _near(found: Found, rule: Rule) -> tuple[Rung, ...]:
    """Return judged models that promise to pay over the chosen one, the best first."""
    scales, top = found.scales, found.top
    assert scales is not None
    hopeful = [
        rung
        for effects, rung in found.judged.items()
        if len(effects) > len(found.chosen)
        and scales.gain(top.errors.waypoint, rung.errors.waypoint).promises(rule)
    ]
    return tuple(sorted(hopeful, key=lambda rung: scales.typical(rung.errors.waypoint)))
