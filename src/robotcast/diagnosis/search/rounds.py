"""Finding the missing effects: screen, refit the few best, keep what pays on held-out trials."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.revision import Revision, fit_base, held_out, refit
from robotcast.diagnosis.search.floor import Floor
from robotcast.diagnosis.search.found import Effort, Found, Rung
from robotcast.diagnosis.search.gain import Gain, gain, seen_gain, worse
from robotcast.diagnosis.search.profile import Profile
from robotcast.diagnosis.search.screen import Screened, looks, screen
from robotcast.diagnosis.search.sizes import sizes_of_effect
from robotcast.diagnosis.side_by_side import side_by_side
from robotcast.fitting.least_squares import Fit, trial_losses

CONTENDERS = 5  # effects that a later round fits to beginnings of trials; the first, all
LEADERS = 4  # of these, refitted to the end; half as many in later rounds
IN_THE_RUNNING = 0.15  # of the best loss: refits that are no worse than that go on
FINALISTS = 2  # of these, judged on held-out trials
MOST_EFFECTS = 3
HOPE = 0.05  # of what is missed on beginnings that a later one must take away
EQUAL = 0.05  # p-value above which two revisions explain the trials equally well


def search(
    inquiry: Inquiry,
    candidates: Sequence[str],
    fixed: Sequence[str],
    floor: Floor,
    effort: Effort,
    tell: Callable[[Found, str], object],
) -> Found:
    """Add effects to the model until none pays.

    Parameters
    ----------
    candidates : names of the effects to try.
    fixed : effects that act from the start.
    tell : called after each step with what is known and what comes next.
    """
    found = Found()
    tell(found, "fitting the model as it is")
    base = fit_base(inquiry, fixed, effort.seed, effort.base)
    found = replace(found, ladder=(_rung(inquiry, base, effort),))
    while len(found.ladder) <= MOST_EFFECTS and not floor.reached(found.ladder[-1].errors.waypoint):
        found, added = _round(inquiry, found, candidates, floor, effort, tell)
        if not added:
            break
    return _without_needless(inquiry, found, len(fixed), floor, effort, tell)


def _rung(
    inquiry: Inquiry, revision: Revision, effort: Effort, predicted: float | None = None
) -> Rung:
    return Rung(revision, held_out(inquiry, revision, effort.seed, effort.fold), predicted)


def _round(
    inquiry: Inquiry,
    found: Found,
    candidates: Sequence[str],
    floor: Floor,
    effort: Effort,
    tell: Callable[[Found, str], object],
) -> tuple[Found, bool]:
    """Screen every candidate on top of the ladder and add the best, if one pays."""
    top = found.ladder[-1]
    names = [name for name in candidates if name not in top.revision.effects]
    later = len(found.ladder) > 1
    profile = Profile.of(inquiry, top.revision)
    asked = (profile.early, profile.revision) if later else (inquiry, top.revision)
    looked, screens = looks(*asked, names), {}
    for name in names:
        tell(found, f"looking at {name}")
        screens[name] = next(looked)
    found = replace(found, screens=(*found.screens, screens))
    usable = sorted((one for one in screens.values() if one.status is None), key=_start_loss)
    tell(found, "refitting the model around every effect")
    if later:
        begun = _generalising(profile, profile.contenders(usable[:CONTENDERS], LEADERS // 2), floor)
    else:
        begun = profile.contenders(usable, LEADERS)
    tell(found, f"refitting with {', '.join(name for name, _ in begun)}")

    def whole(started: tuple[str, Fit]) -> _Refitted:
        name, start = started
        revision = _refit(inquiry, (*top.revision.effects, name), start.vector, effort.refit - 1)
        screened = screen(inquiry, top.revision, name) if later else screens[name]
        return _Refitted(screened, revision)

    fitted = list(side_by_side(whole, begun))
    if later:
        fitted = [one for one in fitted if _seen_gain(inquiry, top, one, floor).may_pay]
    tell(found, "refitting the best further")
    fitted = _further(inquiry, fitted)
    if later:
        fitted = [one for one in fitted if _seen_gain(inquiry, top, one, floor).pays]
    if not fitted:
        return found, False
    top = _rematch(inquiry, top, fitted[0].revision, effort)
    found = replace(found, ladder=(*found.ladder[:-1], top))
    rungs = []
    for one in fitted[:FINALISTS]:
        tell(found, f"judging {one.screened.effect} on trials held out")
        rung = _rung(inquiry, one.revision, effort, one.screened.predicted)
        rungs.append(replace(rung, gain=_gain(inquiry, top, rung, floor)))
    refits = {rung.revision.effects[-1]: rung for rung in rungs}
    found = replace(found, refits=found.refits | refits)
    paying = [rung for rung in rungs if rung.gain and rung.gain.pays and _acts(inquiry, rung)]
    if not paying:
        return found, False
    best = min(paying, key=lambda rung: floor.misses(rung.errors.waypoint).mean())
    name = best.revision.effects[-1]
    rivals = _rivals(inquiry, fitted, best.revision)
    ladder, rivals_of = (*found.ladder, best), found.rivals | {name: rivals}
    return replace(found, ladder=ladder, rivals=rivals_of), True


def _start_loss(one: Screened) -> float:
    return one.loss


def _generalising(
    profile: Profile, begun: Sequence[tuple[str, Fit]], floor: Floor
) -> list[tuple[str, Fit]]:
    """Return the fits that miss beginnings held out less than the model without them."""
    before = floor.misses(profile.own_errors()).mean()
    return [
        (name, fit)
        for name, fit in begun
        if floor.misses(profile.errors(name, fit)).mean() < (1 - HOPE) * before
    ]


@dataclass(frozen=True)
class _Refitted:
    screened: Screened
    revision: Revision

    @property
    def loss(self) -> float:
        return self.revision.fit.loss


def _further(inquiry: Inquiry, fitted: Sequence[_Refitted]) -> list[_Refitted]:
    """Go on with the refits that are still in the running; the best comes first."""
    best = min((one.loss for one in fitted), default=0.0)

    def on(one: _Refitted) -> _Refitted:
        if one.loss > (1 + IN_THE_RUNNING) * best:
            return one
        return replace(one, revision=refit(inquiry, one.revision, 2))

    return sorted(side_by_side(on, fitted), key=lambda one: one.loss)


def _seen_gain(inquiry: Inquiry, top: Rung, one: _Refitted, floor: Floor) -> Gain:
    return seen_gain(inquiry, top.revision.fit, one.revision.fit, floor)


def _rivals(inquiry: Inquiry, fitted: Sequence[_Refitted], best: Revision) -> tuple[str, ...]:
    """Return the effects that explain the trials about as well as the best one.

    Their refits see the same trials as the best one's, so that losses compare them, trial by
    trial: sensitivities that point the same way are not enough to confuse two effects when a
    refit tells them apart.
    """
    names = []
    for one in fitted:
        extra = trial_losses(one.revision.fit.residual) - trial_losses(best.fit.residual)
        if one.revision is not best and worse(extra, inquiry.groups) > EQUAL:
            names.append(one.screened.effect)
    return tuple(names)


def _refit(
    inquiry: Inquiry, effects: tuple[str, ...], start: np.ndarray, iterations: int
) -> Revision:
    return Revision(effects, inquiry.fit(effects, start, iterations))


def _rematch(inquiry: Inquiry, top: Rung, rival: Revision, effort: Effort) -> Rung:
    """Give the model as it is the rival's parameters to start from.

    A refit that lands in a better valley of the old parameters would else count for the effect.
    """
    effects = top.revision.effects
    start = rival.fit.vector[: len(top.revision.fit.vector)]
    again = _refit(inquiry, effects, start, effort.refit)
    if again.fit.loss >= top.revision.fit.loss:
        return top
    return replace(_rung(inquiry, again, effort, top.predicted), gain=top.gain)


def _gain(inquiry: Inquiry, before: Rung, after: Rung, floor: Floor) -> Gain:
    return gain(before.errors.waypoint, after.errors.waypoint, inquiry.groups, floor)


def _acts(inquiry: Inquiry, rung: Rung) -> bool:
    """Tell whether the trials tell the last effect of a rung apart from doing nothing.

    A gain may come of the fit's freedom rather than of the effect: then no strength is known
    to be anything but its null, even if the model had no other fault.
    """
    effects, vectors = rung.revision.effects, rung.errors.vectors
    own = sizes_of_effect(inquiry, rung.revision, vectors, effects[-1], discrepancy=0.0)
    return any(size.apart_from_null for size in own)


def _without_needless(
    inquiry: Inquiry,
    found: Found,
    n_fixed: int,
    floor: Floor,
    effort: Effort,
    tell: Callable[[Found, str], object],
) -> Found:
    """Drop an effect that the later ones have made needless."""
    top = found.ladder[-1]
    added = top.revision.effects[n_fixed:]
    if len(added) < 2:
        return found
    for name in added[:-1]:
        tell(found, f"checking whether {name} is still needed")
        fewer = _dropped(inquiry, top.revision, name, effort)
        rung = _rung(inquiry, fewer, effort)
        if not _gain(inquiry, rung, top, floor).pays:
            first = replace(rung, gain=_gain(inquiry, found.ladder[0], rung, floor))
            return replace(found, ladder=(found.ladder[0], first))
    return found


def _dropped(inquiry: Inquiry, revision: Revision, name: str, effort: Effort) -> Revision:
    """Refit a revision without one of its effects, from its own parameters."""
    effects = tuple(e for e in revision.effects if e != name)
    owners = [None] * len(inquiry.model.parameters)
    owners += [e for e in revision.effects for _ in inquiry.model.effects[e].parameters]
    kept = np.array([owner != name for owner in owners])
    return _refit(inquiry, effects, revision.fit.vector[kept], effort.refit)
