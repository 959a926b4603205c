"""What is left when no named effect pays: which field takes most of it away."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from robotcast.diagnosis.floor import Floor
from robotcast.diagnosis.gain import Gain, gain
from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.profile import Profile
from robotcast.diagnosis.revision import Revision, held_out
from robotcast.diagnosis.screen import Screened, looks
from robotcast.diagnosis.search import Effort, Found, Rung
from robotcast.fitting.least_squares import Fit

FLEXIBLE = 0.25  # of the excess over the noise floor that a field must take away
TRIED = 3  # fields fitted to the beginnings of some trials
HOPE = 0.1  # of what is missed there that a field must take away to be fitted to all
ITERATIONS = 2


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
        """Tell whether the field takes away so much that something must be missing."""
        return self.gain.pays and self.gain.share > FLEXIBLE

    def over(self, inquiry: Inquiry, rung: Rung, floor: Floor) -> Gain:
        """Return what the model with the field saves over another one."""
        return gain(rung.errors.waypoint, self.rung.errors.waypoint, inquiry.groups, floor)


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
    left : None when no field takes away enough.
    """
    base, top = found.ladder[0], found.ladder[-1]
    if floor.reached(top.errors.waypoint):
        return found, None
    contest = _Contest(inquiry, fields, floor, effort, tell)
    beside = contest.begin(top)
    if beside is None or beside.missed > (1 - HOPE) * beside.missed_before:
        return found, None
    if top is base:
        left = contest.judged(base, beside)
        return found, left if left.enough else None
    begun = contest.begin(base)
    hopeful = begun is not None and begun.missed < (1 - HOPE) * beside.missed_before
    alone = contest.judged(base, begun) if begun and hopeful else None
    if alone is not None and alone.over(inquiry, top, floor).pays:
        return replace(found, ladder=(base,), rivals={}), alone
    left = contest.judged(top, beside)
    if not left.enough:
        return found, None
    if alone is not None and not left.over(inquiry, alone.rung, floor).pays:
        return replace(found, ladder=(base,), rivals={}), alone
    return found, left


@dataclass(frozen=True)
class _Begun:
    """A field fitted to the beginnings of some trials.

    Attributes
    ----------
    missed, missed_before : what is missed there, held out, with the field and without it.
    """

    screened: Screened
    fit: Fit
    missed: float
    missed_before: float


@dataclass(frozen=True)
class _Contest:
    """Fits fields on top of a model: first beside the beginnings of some trials, then all."""

    inquiry: Inquiry
    fields: Sequence[str]
    floor: Floor
    effort: Effort
    tell: Callable[[str], object]

    def begin(self, below: Rung) -> _Begun | None:
        """Return the field that misses beginnings least, held out, on top of a rung."""
        profile = Profile(self.inquiry, below.revision)
        looked, answers = [], looks(profile.early, profile.revision, self.fields)
        for name in self.fields:
            depends_on = self.inquiry.model.effects[name].depends_on
            self.tell(f"trying a field that depends on {depends_on}")
            looked.append(next(answers))
        usable = sorted((one for one in looked if one.status is None), key=lambda one: one.loss)
        begun, before = [], self._missed(profile.own_errors())
        for one in usable[:TRIED]:
            self.tell(f"beginning with {self._text(one.effect)}")
            fit = profile.with_field(one)
            missed = self._missed(profile.errors(one.effect, fit))
            begun.append(_Begun(one, fit, missed, before))
        return min(begun, key=lambda one: one.missed, default=None)

    def _missed(self, errors: np.ndarray) -> float:
        return float(self.floor.misses(errors).mean())

    def judged(self, below: Rung, begun: _Begun) -> Unexplained:
        """Fit a field to whole trials, on top of a rung, and judge it on trials held out."""
        one = begun.screened
        self.tell(f"fitting {self._text(one.effect)}")
        inquiry, effects = self.inquiry, (*below.revision.effects, one.effect)
        fitted = Revision(effects, inquiry.fit(effects, begun.fit.vector, ITERATIONS))
        errors = held_out(inquiry, fitted, self.effort.seed, self.effort.fold)
        saved = gain(below.errors.waypoint, errors.waypoint, inquiry.groups, self.floor)
        return Unexplained(one.effect, Rung(fitted, errors, one.predicted), saved)

    def _text(self, name: str) -> str:
        return self.inquiry.model.effects[name].text


def strengths(inquiry: Inquiry, found: Unexplained) -> np.ndarray:
    """Return the field's fitted strengths."""
    n = len(inquiry.model.effects[found.field].parameters)
    effects = found.rung.revision.effects
    return inquiry.values(effects, found.rung.revision.fit.vector)[0, -n:]
