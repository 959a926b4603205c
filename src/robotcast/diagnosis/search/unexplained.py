"""What is left when no named effect pays: which field takes most of it away."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.revision import Revision, held_out, refit
from robotcast.diagnosis.search.floor import Floor
from robotcast.diagnosis.search.found import Effort, Found, Rung
from robotcast.diagnosis.search.gain import MUCH, Gain, gain, seen_gain
from robotcast.diagnosis.search.nearest import came_near
from robotcast.diagnosis.search.profile import Profile
from robotcast.diagnosis.search.screen import Screened, looks
from robotcast.fitting.least_squares import Fit

TRIED = 3  # fields fitted to the beginnings of some trials
HOPE = 0.1  # of what is missed there that a field must take away to be fitted to all
LEVEL = 1.1  # fields that miss so little more than the best one are fitted to all as well


@dataclass(frozen=True)
class Unexplained:
    """The field that explains most of what is left.

    Attributes
    ----------
    field : its name among the model's effects.
    rung : the model with it.
    gain : over the model without it, on held-out trials.
    """

    field: str
    rung: Rung
    gain: Gain

    @property
    def enough(self) -> bool:
        """Tell whether the field takes away so much that what is missing must be like it."""
        return self.gain.pays and self.gain.share > MUCH

    def over(self, inquiry: Inquiry, rung: Rung, floor: Floor) -> Gain:
        """Return what the model with the field saves over another one."""
        return gain(rung.errors.waypoint, self.rung.errors.waypoint, inquiry.groups, floor)


def replaces(saved: Gain, named: int) -> bool:
    """Tell whether a field alone explains more than `named` effects, over which it saves this.

    One cause is likelier than several that happen to coincide: against several effects it need
    not be beyond all doubt, where it takes away far more.
    """
    return saved.pays or (named > 1 and saved.promises)


def look_for_the_unknown(
    inquiry: Inquiry,
    found: Found,
    fields: Sequence[str],
    floor: Floor,
    effort: Effort,
    tell: Callable[[str], object],
) -> tuple[Found, Unexplained | None]:
    """Look for a force of no name in what the search left over.

    Returns
    -------
    found : as it was; without the named effects where a field does better alone, or as well as
        beside them: they had only stood in for something that the library does not hold.
    left : None when no field takes away enough; but where the errors lie far above the noise
        floor something is missing all the same, and the field that comes nearest is returned.
    """
    base, top = found.ladder[0], found.ladder[-1]
    if floor.reached(top.errors.waypoint):
        return found, None
    contest = _Contest(inquiry, fields, floor, effort, tell)
    on_top = Profile.of(inquiry, top.revision)
    missed = contest.missed(on_top.own_errors())
    most_missed = (1 - HOPE) * missed
    named = len(top.revision.effects) - len(base.revision.effects)
    alone_may = LEVEL * missed if named > 1 else most_missed
    alone = contest.alone(base, top, alone_may) if named else None
    if alone is not None and replaces(alone.over(inquiry, top, floor), named):
        return replace(found, ladder=(base,), rivals={}), alone
    begun = contest.begin(on_top)
    left = contest.judged(top, begun, most_missed)
    if (left is None or not left.enough) and floor.above(top.errors.waypoint):
        left = contest.nearest(top, begun)
    if left is None or not left.enough:
        return found, left if floor.far_above(top.errors.waypoint) else None
    if not named and _named_as_well(inquiry, found, left, floor):
        return found, None
    if alone is not None and not left.over(inquiry, alone.rung, floor).pays:
        return replace(found, ladder=(base,), rivals={}), alone
    return found, left


def _named_as_well(inquiry: Inquiry, found: Found, left: Unexplained, floor: Floor) -> bool:
    """Tell whether an effect that came near explains as much as a field, which is freer to fit."""
    near = came_near(found, inquiry.groups, floor)
    if not near:
        return False
    named, freer = (floor.misses(rung.errors.waypoint).mean() for rung in (near[0], left.rung))
    return bool(named <= freer)


@dataclass(frozen=True)
class _Begun:
    """A field fitted to the beginnings of some trials, and what it misses of them, held out."""

    screened: Screened
    fit: Fit
    missed: float


def _level(begun: Sequence[_Begun]) -> list[_Begun]:
    """Return the fields that miss about as little as the best one."""
    least = min((one.missed for one in begun), default=0.0)
    return [one for one in begun if one.missed <= LEVEL * least]


@dataclass(frozen=True)
class _Contest:
    """Fits fields on top of a model: first beside the beginnings of some trials, then all."""

    inquiry: Inquiry
    fields: Sequence[str]
    floor: Floor
    effort: Effort
    tell: Callable[[str], object]

    def alone(self, base: Rung, top: Rung, most_missed: float) -> Unexplained | None:
        """Return the best field in the place of the named effects, None if it has no hope.

        It starts from the parameters that the model has beside the named effects: without
        them and without a field they have moved far away to stand in for what is missing.
        """
        own = top.revision.fit.vector[: len(base.revision.fit.vector)]
        begun = self.begin(Profile(self.inquiry, base.revision.effects, own, iterations=0))
        return self.judged(base, begun, most_missed)

    def begin(self, profile: Profile) -> list[_Begun]:
        """Return fields fitted to beginnings; the one that misses least, held out, comes first."""
        looked, answers = [], looks(profile.early, profile.revision, self.fields)
        for name in self.fields:
            depends_on = self.inquiry.model.effects[name].depends_on
            self.tell(f"trying a field that depends on {depends_on}")
            looked.append(next(answers))
        usable = sorted((one for one in looked if one.status is None), key=lambda one: one.loss)
        begun = []
        for one in usable[:TRIED]:
            self.tell(f"beginning with {self._text(one.effect)}")
            fit = profile.with_field(one)
            begun.append(_Begun(one, fit, self.missed(profile.errors(one.effect, fit))))
        return sorted(begun, key=lambda one: one.missed)

    def missed(self, errors: np.ndarray) -> float:
        """Return how much is missed on average, in what actions scatter by."""
        return float(self.floor.misses(errors).mean())

    def judged(
        self, below: Rung, begun: Sequence[_Begun], most_missed: float
    ) -> Unexplained | None:
        """Fit the best fields to whole trials; judge the better one on trials held out.

        None when they miss too much of the beginnings.
        """
        if not begun or begun[0].missed > most_missed:
            return None
        best_of = {self._depends_on(one): one for one in reversed(begun)}  # of each dependence
        one, revision = self._whole(below, _level(list(best_of.values())))[0]
        if not self._seen_gain(below, revision).may_pay:
            return None
        self.tell("refitting it further")
        revision = refit(self.inquiry, revision, 2)
        if not self._seen_gain(below, revision).pays:
            return None
        return self._on_trials_held_out(below, one, revision)

    def nearest(self, below: Rung, begun: Sequence[_Begun]) -> Unexplained | None:
        """Fit the fields to whole trials; judge the best of them, however little it takes away."""
        fits = self._whole(below, _level(begun))
        if not fits:
            return None
        one, revision = fits[0]
        return self._on_trials_held_out(below, one, refit(self.inquiry, revision, 2))

    def _whole(self, below: Rung, begun: Sequence[_Begun]) -> list[tuple[Screened, Revision]]:
        """Go one step on whole trials with each; the one that fits best comes first."""
        fits = []
        for one in begun:
            self.tell(f"fitting {self._text(one.screened.effect)}")
            effects = (*below.revision.effects, one.screened.effect)
            fit = self.inquiry.fit(effects, one.fit.vector, 1)
            fits.append((one.screened, Revision(effects, fit)))
        return sorted(fits, key=lambda fitted: fitted[1].fit.loss)

    def _on_trials_held_out(self, below: Rung, one: Screened, revision: Revision) -> Unexplained:
        self.tell("judging it on trials held out")
        errors = held_out(self.inquiry, revision, self.effort.seed, self.effort.fold)
        saved = gain(below.errors.waypoint, errors.waypoint, self.inquiry.groups, self.floor)
        return Unexplained(one.effect, Rung(revision, errors, one.predicted), saved)

    def _seen_gain(self, below: Rung, revision: Revision) -> Gain:
        return seen_gain(self.inquiry, below.revision.fit, revision.fit, self.floor)

    def _depends_on(self, begun: _Begun) -> str | None:
        return self.inquiry.model.effects[begun.screened.effect].depends_on

    def _text(self, name: str) -> str:
        return self.inquiry.model.effects[name].text


def strengths(inquiry: Inquiry, found: Unexplained) -> np.ndarray:
    """Return the field's fitted strengths."""
    n = len(inquiry.model.effects[found.field].parameters)
    effects = found.rung.revision.effects
    return inquiry.values(effects, found.rung.revision.fit.vector)[0, -n:]
