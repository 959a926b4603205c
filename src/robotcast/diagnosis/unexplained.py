"""What is left when no named effect pays: which field takes most of it away."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from robotcast.diagnosis.floor import Floor
from robotcast.diagnosis.gain import Gain, gain
from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.profile import Profile
from robotcast.diagnosis.revision import Revision, held_out
from robotcast.diagnosis.screen import looks, screen
from robotcast.diagnosis.search import Effort, Found, Rung

FLEXIBLE = 0.25  # of the excess over the noise floor that a field must take away
TRIED = 2  # fields fitted to the beginnings of some trials
HOPE = 0.1  # of the loss there that a field must take away to be fitted to all
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


def look_for_the_unknown(
    inquiry: Inquiry,
    found: Found,
    fields: Sequence[str],
    floor: Floor,
    effort: Effort,
    tell: Callable[[str], object],
) -> tuple[Found, Unexplained | None]:
    """Fit the most promising field to what the search left over.

    Returns
    -------
    found : as it was; without the named effects where the field does as well alone: they had
        only stood in for something that the library does not hold.
    left : None when no field takes away enough.
    """
    base, top = found.ladder[0], found.ladder[-1]
    if floor.reached(top.errors.waypoint):
        return found, None
    search = _Fields(inquiry, floor, effort, tell)
    name = search.most_promising(top.revision, fields)
    if name is None:
        return found, None
    left = search.judged(top, name)
    if not left.enough:
        return found, None
    if top is not base:
        alone = search.judged(base, name)
        extra = gain(alone.rung.errors.waypoint, left.rung.errors.waypoint, inquiry.groups, floor)
        if floor.reached(alone.rung.errors.waypoint) or not extra.pays:
            return replace(found, ladder=(base,), rivals={}), alone
    return found, left


@dataclass(frozen=True)
class _Fields:
    """Fits fields on top of a revision: first beside the beginnings of some trials, then all."""

    inquiry: Inquiry
    floor: Floor
    effort: Effort
    tell: Callable[[str], object]

    def most_promising(self, revision: Revision, fields: Sequence[str]) -> str | None:
        """Return the field with the least error on beginnings held out, None if none promises."""
        profile = Profile(self.inquiry, revision)
        looked, answers = [], looks(profile.early, profile.revision, fields)
        for name in fields:
            depends_on = self.inquiry.model.effects[name].depends_on
            self.tell(f"trying a field that depends on {depends_on}")
            looked.append(next(answers))
        usable = sorted((one for one in looked if one.status is None), key=lambda one: one.loss)
        fits = {}
        for one in usable[:TRIED]:
            self.tell(f"fitting {self.inquiry.model.effects[one.effect].text} to beginnings")
            fits[one.effect] = profile.with_field(one)
        promising = [name for name, fit in fits.items() if profile.promises(fit, HOPE)]
        misses = {name: profile.misses(name, fits[name]) for name in promising}
        return min(promising, key=lambda name: misses[name], default=None)

    def judged(self, below: Rung, name: str) -> Unexplained:
        """Fit a field on top of a rung and judge it on trials held out."""
        inquiry, effort, revision = self.inquiry, self.effort, below.revision
        self.tell(f"fitting {inquiry.model.effects[name].text}")
        effects = (*revision.effects, name)
        looked = screen(inquiry, revision, name)
        begun = Profile(inquiry, revision).with_field(looked)
        fitted = Revision(effects, inquiry.fit(effects, begun.vector, ITERATIONS))
        rung = Rung(fitted, held_out(inquiry, fitted, effort.seed, effort.fold), looked.predicted)
        saved = gain(below.errors.waypoint, rung.errors.waypoint, inquiry.groups, self.floor)
        return Unexplained(name, rung, saved)


def strengths(inquiry: Inquiry, found: Unexplained) -> np.ndarray:
    """Return the field's fitted strengths."""
    n = len(inquiry.model.effects[found.field].parameters)
    effects = found.rung.revision.effects
    return inquiry.values(effects, found.rung.revision.fit.vector)[0, -n:]
