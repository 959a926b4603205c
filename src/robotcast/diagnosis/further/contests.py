"""What further trials should decide: which of two effects, or whether one is there at all."""

from collections.abc import Mapping, Sequence

import numpy as np

from robotcast.diagnosis.decision import Verdict
from robotcast.diagnosis.further.next_trials import Contest
from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.revision import Revision
from robotcast.diagnosis.rule import Rule
from robotcast.diagnosis.screen import Screened
from robotcast.diagnosis.selection import Found

MOST_RIVALS, MOST_WEAK = 4, 8
ITERATIONS = 3  # of a fit that only has to show what a rival would predict


def open_contests(
    inquiry: Inquiry,
    found: Found,
    base: Revision,
    verdict: Verdict,
    screens: Mapping[str, Screened],
    rule: Rule,
) -> list[list[Contest]]:
    """Return what is still to be decided, each group only where no trial could decide the former.

    Where nothing is named, these are the effects that came near to it. Where error is left that
    nothing pays for, those that lowered it most, and everywhere those that the trials would
    hardly show.

    Parameters
    ----------
    base : the model as it is, all there is where the trials are too few.
    screens : what the first look said of every effect.
    """
    rivals = [(name, rival) for name in verdict.named for rival in found.rivals.get(name, ())]
    if rivals:
        return [[_between(inquiry, found, *pair) for pair in rivals[:MOST_RIVALS]]]
    top = found.top.revision if found.judged and verdict.named else base
    near = [rung.revision for rung in verdict.near]
    first = [*_which_of(near), *(_added(one, top) for one in near)]
    left = verdict.left
    if left is not None and left.rung is not None:
        field = left.rung.revision
        return [first, [Contest(("unknown",), top, (field.effects, field.fit.vector))]]
    weak = [
        one
        for name, one in screens.items()
        if name not in top.effects and one.power < rule.enough_power and one.moved > 0
    ]
    weak.sort(key=lambda one: (one.power, one.p_value))
    tried = [r.revision for e, r in found.judged.items() if e[:-1] == top.effects]
    hardly_seen = [_whether_there(inquiry, top, one.effect) for one in weak[:MOST_WEAK]]
    return [first, [*(_added(one, top) for one in tried if left is not None), *hardly_seen]]


def _which_of(near: Sequence[Revision]) -> list[Contest]:
    """Set the refit that came nearest against the others that explain as much."""
    if not near:
        return []
    first, *others = near
    return [
        Contest(
            (first.effects[-1], other.effects[-1]), first, (other.effects, other.fit.vector), other
        )
        for other in others
    ]


def _added(refitted: Revision, top: Revision) -> Contest:
    """Set the model as it is against a refit with more effects, which did not pay."""
    names = refitted.effects[len(top.effects) :][-1:]
    return Contest(names, top, (refitted.effects, refitted.fit.vector), refitted)


def _between(inquiry: Inquiry, found: Found, name: str, rival: str) -> Contest:
    """Set the chosen effects against the same with one that does as well in a place of theirs."""
    first = found.top.revision
    wanted = (set(first.effects) - {name}) | {rival}
    effects = next(e for e in found.early if set(e) == wanted)
    if effects in found.judged:
        second = found.judged[effects].revision
    else:
        second = _fitted(inquiry, effects, found.early[effects].vector)
    return Contest((name, rival), first, (second.effects, second.fit.vector), second)


def _fitted(inquiry: Inquiry, effects: tuple[str, ...], start: np.ndarray) -> Revision:
    return Revision(effects, inquiry.fit(effects, start, ITERATIONS))


def _whether_there(inquiry: Inquiry, top: Revision, effect: str) -> Contest:
    """Set the model as it is against the same model with a little of one effect."""
    effects, first = (*top.effects, effect), len(top.fit.vector)
    vector = inquiry.nominal(effects)
    vector[:first] = top.fit.vector
    for k, parameter in enumerate(inquiry.model.effects[effect].parameters, first):
        if parameter.null is not None:
            null = float(parameter.to_unit(np.asarray(parameter.null)))
            probes = [float(parameter.to_unit(np.asarray(probe))) for probe in parameter.probes]
            vector[k] = min(probes, key=lambda probe: abs(probe - null))
    return Contest((effect,), top, (effects, vector))
