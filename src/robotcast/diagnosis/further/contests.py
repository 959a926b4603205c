"""What further trials should decide: which of two effects, or whether one is there at all."""

from collections.abc import Sequence

import numpy as np

from robotcast.diagnosis.further.next_trials import Contest
from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.revision import Revision
from robotcast.diagnosis.search.floor import Floor
from robotcast.diagnosis.search.found import Found, Rung
from robotcast.diagnosis.search.screen import Screened
from robotcast.diagnosis.search.unexplained import Unexplained

ENOUGH_POWER = 0.8
MOST_RIVALS, MOST_WEAK = 4, 8
ITERATIONS = 3  # of a fit that only has to show what a rival would predict


def open_contests(
    inquiry: Inquiry,
    found: Found,
    top: Revision,
    named: Sequence[str],
    left: Unexplained | None,
    near: Sequence[Rung],
    floor: Floor,
) -> list[list[Contest]]:
    """Return what is still to be decided, each group only where no trial could decide the former.

    Where nothing is named, these are the effects that came near to it. Where error is left that
    nothing pays for, those that lowered it most, and everywhere those that the trials would
    hardly show.

    Parameters
    ----------
    top : the model that the search ended with.
    named : effects that the verdict names.
    near : refits on top of it that came near to being named.
    """
    rivals = [(name, rival) for name in named for rival in found.rivals.get(name, ())]
    if rivals:
        return [[_between(inquiry, found, *pair) for pair in rivals[:MOST_RIVALS]]]
    first = [*_which_of(near), *(_added(rung.revision, top) for rung in near)] if near else []
    if left is not None:
        field = left.rung.revision
        return [first, [Contest(("unknown",), top, (field.effects, field.fit.vector))]]
    screens = found.screens[0] if found.screens else {}  # later ones see fewer trials
    absent = [one for name, one in screens.items() if name not in top.effects]
    weak = [one for one in absent if one.power < ENOUGH_POWER and one.moved > 0]
    weak.sort(key=lambda one: (one.power, one.p_value))
    above = found.ladder and floor.above(found.ladder[-1].errors.waypoint)
    tried = [rung.revision for rung in found.refits.values()] if above else []
    refitted = [_added(one, top) for one in tried if one.effects[:-1] == top.effects]
    hardly_seen = [_whether_there(inquiry, top, one) for one in weak[:MOST_WEAK]]
    return [first, [*refitted, *hardly_seen]]


def _which_of(near: Sequence[Rung]) -> list[Contest]:
    """Set the refit that came nearest against the others that explain as much."""
    first, *others = (rung.revision for rung in near)
    return [
        Contest(
            (first.effects[-1], other.effects[-1]), first, (other.effects, other.fit.vector), other
        )
        for other in others
    ]


def _added(refitted: Revision, top: Revision) -> Contest:
    """Set the model as it is against a refit with one effect more, which did not pay."""
    return Contest(refitted.effects[-1:], top, (refitted.effects, refitted.fit.vector), refitted)


def _between(inquiry: Inquiry, found: Found, name: str, rival: str) -> Contest:
    """Set an effect of the ladder against one that does as well in its place."""
    at = next(k for k, rung in enumerate(found.ladder) if name in rung.revision.effects)
    first, below = found.ladder[at].revision, found.ladder[at - 1].revision
    effects = (*below.effects, rival)
    rung = found.refits.get(rival)
    if rung is not None and rung.revision.effects == effects:
        second = rung.revision
    else:
        second = _fitted(inquiry, effects, _start(inquiry, found, below, rival))
    return Contest((name, rival), first, (second.effects, second.fit.vector), second)


def _start(inquiry: Inquiry, found: Found, below: Revision, rival: str) -> np.ndarray:
    """Return where a fit with the rival starts: where its screen of that round ended."""
    n = len(inquiry.parameters((*below.effects, rival)))
    starts = [s[rival].start for s in found.screens if rival in s and len(s[rival].start) == n]
    own = inquiry.nominal((rival,))[len(inquiry.model.parameters) :]
    return starts[0] if starts else np.concatenate([below.fit.vector, own])


def _fitted(inquiry: Inquiry, effects: tuple[str, ...], start: np.ndarray) -> Revision:
    return Revision(effects, inquiry.fit(effects, start, ITERATIONS))


def _whether_there(inquiry: Inquiry, top: Revision, one: Screened) -> Contest:
    """Set the model as it is against the same model with a little of one effect."""
    effects, first = (*top.effects, one.effect), len(top.fit.vector)
    own = one.start[-len(inquiry.model.effects[one.effect].parameters) :]
    vector = np.concatenate([top.fit.vector, own])
    for k, parameter in enumerate(inquiry.model.effects[one.effect].parameters, first):
        if parameter.null is not None:
            null = float(parameter.to_unit(np.asarray(parameter.null)))
            probes = [float(parameter.to_unit(np.asarray(probe))) for probe in parameter.probes]
            vector[k] = min(probes, key=lambda probe: abs(probe - null))
    return Contest((one.effect,), top, (effects, vector))
