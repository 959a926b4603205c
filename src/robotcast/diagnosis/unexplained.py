"""What is left when no named effect pays: which field takes most of it away."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from robotcast.diagnosis.gain import Gain, gain
from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.revision import Revision, held_out
from robotcast.diagnosis.screen import Screened, screen
from robotcast.diagnosis.search import Effort, Found, Rung, at_the_floor

FLEXIBLE = 0.25  # of the excess over the noise floor that a field must take away
ITERATIONS = 3


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
    floor: float | None,
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
    if at_the_floor(top, floor):
        return found, None
    one = _most_promising(inquiry, top.revision, fields, tell)
    if one is None:
        return found, None
    left = _with_field(inquiry, top, one, floor, effort, tell)
    if not left.enough:
        return found, None
    if top is not base:
        alone = _with_field(inquiry, base, one, floor, effort, tell)
        extra = gain(alone.rung.errors.waypoint, left.rung.errors.waypoint, inquiry.groups, floor)
        if not extra.pays:
            return replace(found, ladder=(base,), rivals={}), alone
    return found, left


def _most_promising(
    inquiry: Inquiry, revision: Revision, fields: Sequence[str], tell: Callable[[str], object]
) -> Screened | None:
    looked = []
    for name in fields:
        tell(f"trying a field that depends on {inquiry.model.effects[name].depends_on}")
        looked.append(screen(inquiry, revision, name))
    usable = [one for one in looked if one.status is None]
    return min(usable, key=lambda one: one.loss, default=None)


def _with_field(
    inquiry: Inquiry,
    below: Rung,
    one: Screened,
    floor: float | None,
    effort: Effort,
    tell: Callable[[str], object],
) -> Unexplained:
    """Fit a field on top of a rung and judge it on trials held out."""
    tell(f"fitting {inquiry.model.effects[one.effect].text}")
    effects = (*below.revision.effects, one.effect)
    n = len(inquiry.model.effects[one.effect].parameters)
    start = np.concatenate([below.revision.fit.vector, one.start[-n:]])
    revision = Revision(effects, inquiry.fit(effects, start, ITERATIONS))
    rung = Rung(revision, held_out(inquiry, revision, effort.seed, effort.fold), one.predicted)
    saved = gain(below.errors.waypoint, rung.errors.waypoint, inquiry.groups, floor)
    return Unexplained(one.effect, rung, saved)


def strengths(inquiry: Inquiry, found: Unexplained) -> np.ndarray:
    """Return the field's fitted strengths."""
    n = len(inquiry.model.effects[found.field].parameters)
    effects = found.rung.revision.effects
    return inquiry.values(effects, found.rung.revision.fit.vector)[0, -n:]
