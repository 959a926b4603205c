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
ITERATIONS = 3  # of a refit that starts from the best one's parameters
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
    run = _Run(inquiry, floor, effort, tell)
    run.begin(fixed)
    while len(run.found.ladder) <= MOST_EFFECTS and not run.at_the_floor and run.add(candidates):
        pass
    run.drop_needless(len(fixed))
    return run.found


class _Run:
    """A search under way; `found` is what it knows so far."""

    def __init__(
        self, inquiry: Inquiry, floor: Floor, effort: Effort, tell: Callable[[Found, str], object]
    ) -> None:
        self._inquiry, self._floor, self._effort, self._tell = inquiry, floor, effort, tell
        self.found = Found()

    @property
    def top(self) -> Rung:
        """The model that it stands at."""
        return self.found.ladder[-1]

    @property
    def at_the_floor(self) -> bool:
        """Whether nothing is left to explain."""
        return self._floor.reached(self.top.errors.waypoint)

    def begin(self, fixed: Sequence[str]) -> None:
        """Fit the model as it is."""
        self._next("fitting the model as it is")
        base = fit_base(self._inquiry, fixed, self._effort.seed, self._effort.base)
        self.found = replace(self.found, ladder=(self._rung(base),))

    def add(self, candidates: Sequence[str]) -> bool:
        """Screen every candidate on top of the ladder and add the best, if one pays."""
        fitted = self._refitted([n for n in candidates if n not in self.top.revision.effects])
        if not fitted:
            return False
        self._rematch(fitted[0].revision)
        rungs = [self._judged(one) for one in fitted[:FINALISTS]]
        refits = {rung.revision.effects[-1]: rung for rung in rungs}
        self.found = replace(self.found, refits=self.found.refits | refits)
        paying = [r for r in rungs if r.gain and r.gain.pays and _acts(self._inquiry, r)]
        if not paying:
            return False
        best = min(paying, key=lambda rung: self._floor.misses(rung.errors.waypoint).mean())
        rivals = {best.revision.effects[-1]: _rivals(self._inquiry, fitted, best.revision)}
        ladder = (*self.found.ladder, best)
        self.found = replace(self.found, ladder=ladder, rivals=self.found.rivals | rivals)
        return True

    def drop_needless(self, n_fixed: int) -> None:
        """Drop an effect that the later ones have made needless."""
        added = self.top.revision.effects[n_fixed:]
        for name in added[:-1]:
            self._next(f"checking whether {name} is still needed")
            rung = self._rung(_dropped(self._inquiry, self.top.revision, name, self._effort))
            if not self._gain(rung, self.top).pays:
                first = self.found.ladder[0]
                ladder = (first, replace(rung, gain=self._gain(first, rung)))
                self.found = replace(self.found, ladder=ladder)
                return

    def _refitted(self, names: Sequence[str]) -> list["_Refitted"]:
        """Return the refits that are still in the running, the best first.

        Later effects go on only where they pay on the trials that they are fitted to: what does
        not pay there does not pay on others.
        """
        inquiry, top, later = self._inquiry, self.top, len(self.found.ladder) > 1
        profile = Profile.of(inquiry, top.revision)
        screens = self._looked_at(names, profile if later else None)
        usable = sorted((one for one in screens.values() if one.status is None), key=_start_loss)
        self._next("refitting the model around every effect")
        if later:
            begun = profile.contenders(usable[:CONTENDERS], LEADERS // 2)
            begun = _generalising(profile, begun, self._floor)
        else:
            begun = profile.contenders(usable, LEADERS)
        self._next(f"refitting with {', '.join(name for name, _ in begun)}")

        def whole(started: tuple[str, Fit]) -> _Refitted:
            name, start = started
            effects, iterations = (*top.revision.effects, name), self._effort.refit - 1
            revision = _refit(inquiry, effects, start.vector, iterations)
            screened = screen(inquiry, top.revision, name) if later else screens[name]
            return _Refitted(screened, revision)

        fitted = list(side_by_side(whole, begun))
        if later:
            fitted = [one for one in fitted if self._seen_gain(one).may_pay]
        self._next("refitting the best further")
        fitted = _further(inquiry, fitted)
        if fitted and self._seen_gain(fitted[0]).pays:
            fitted = _from_the_best(inquiry, top.revision, fitted)
        return [one for one in fitted if self._seen_gain(one).pays] if later else fitted

    def _looked_at(self, names: Sequence[str], profile: Profile | None) -> dict[str, Screened]:
        """Screen effects on whole trials, or on the beginnings that a profile knows."""
        asked = (profile.early, profile.revision) if profile else (self._inquiry, self.top.revision)
        looked, screens = looks(*asked, names), {}
        for name in names:
            self._next(f"looking at {name}")
            screens[name] = next(looked)
        self.found = replace(self.found, screens=(*self.found.screens, screens))
        return screens

    def _rematch(self, rival: Revision) -> None:
        """Give the model as it is the rival's parameters to start from.

        A refit that lands in a better valley of the old parameters would else count for the effect.
        """
        top = self.top
        start = rival.fit.vector[: len(top.revision.fit.vector)]
        again = _refit(self._inquiry, top.revision.effects, start, self._effort.refit)
        if again.fit.loss < top.revision.fit.loss:
            rung = replace(self._rung(again, top.predicted), gain=top.gain)
            self.found = replace(self.found, ladder=(*self.found.ladder[:-1], rung))

    def _judged(self, one: "_Refitted") -> Rung:
        self._next(f"judging {one.screened.effect} on trials held out")
        rung = self._rung(one.revision, one.screened.predicted)
        return replace(rung, gain=self._gain(self.top, rung))

    def _rung(self, revision: Revision, predicted: float | None = None) -> Rung:
        errors = held_out(self._inquiry, revision, self._effort.seed, self._effort.fold)
        return Rung(revision, errors, predicted)

    def _gain(self, before: Rung, after: Rung) -> Gain:
        errors = before.errors.waypoint, after.errors.waypoint
        return gain(*errors, self._inquiry.groups, self._floor)

    def _seen_gain(self, one: "_Refitted") -> Gain:
        return seen_gain(self._inquiry, self.top.revision.fit, one.revision.fit, self._floor)

    def _next(self, step: str) -> None:
        self._tell(self.found, step)


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


def _from_the_best(inquiry: Inquiry, top: Revision, fitted: Sequence[_Refitted]) -> list[_Refitted]:
    """Fit every refit but the best again, from what the best one has beside its effect.

    One that stays in a worse valley of the old parameters would else lose for that, not for its
    effect. The best comes first.
    """
    n = len(top.fit.vector)
    best = fitted[0].revision.fit.vector[:n]

    def again(one: _Refitted) -> _Refitted:
        start = np.concatenate([best, one.revision.fit.vector[n:]])
        other = _refit(inquiry, one.revision.effects, start, ITERATIONS)
        return replace(one, revision=other) if other.fit.loss < one.loss else one

    others = side_by_side(again, fitted[1:])
    return sorted([fitted[0], *others], key=lambda one: one.loss)


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


def _acts(inquiry: Inquiry, rung: Rung) -> bool:
    """Tell whether the trials tell the last effect of a rung apart from doing nothing.

    A gain may come of the fit's freedom rather than of the effect: then no strength is known
    to be anything but its null, even if the model had no other fault.
    """
    effects, vectors = rung.revision.effects, rung.errors.vectors
    own = sizes_of_effect(inquiry, rung.revision, vectors, effects[-1], discrepancy=0.0)
    return any(size.apart_from_null for size in own)


def _dropped(inquiry: Inquiry, revision: Revision, name: str, effort: Effort) -> Revision:
    """Refit a revision without one of its effects, from its own parameters."""
    effects = tuple(e for e in revision.effects if e != name)
    owners = [None] * len(inquiry.model.parameters)
    owners += [e for e in revision.effects for _ in inquiry.model.effects[e].parameters]
    kept = np.array([owner != name for owner in owners])
    return _refit(inquiry, effects, revision.fit.vector[kept], effort.refit)
