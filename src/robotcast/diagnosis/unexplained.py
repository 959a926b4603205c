"""What is left when no named effect pays: which field takes most of it away."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from robotcast.diagnosis.gain import Gain, gain
from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.revision import Revision, held_out
from robotcast.diagnosis.screen import screen
from robotcast.diagnosis.search import Effort, Rung

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


def look_for_the_unknown(
    inquiry: Inquiry,
    top: Rung,
    fields: Sequence[str],
    floor: float | None,
    effort: Effort,
    tell: Callable[[str], object],
) -> Unexplained | None:
    """Fit the most promising field; None when none takes away enough."""
    looked = []
    for name in fields:
        tell(f"trying a field that depends on {inquiry.model.effects[name].depends_on}")
        looked.append(screen(inquiry, top.revision, name))
    usable = [one for one in looked if one.status is None]
    if not usable:
        return None
    best = min(usable, key=lambda one: one.loss)
    effects = (*top.revision.effects, best.effect)
    tell("fitting the field")
    fit = inquiry.fit(effects, best.start, ITERATIONS)
    revision = Revision(effects, fit)
    rung = Rung(revision, held_out(inquiry, revision, effort.seed, 1), best.predicted)
    saved = gain(top.errors.waypoint, rung.errors.waypoint, inquiry.groups, floor)
    if not (saved.pays and saved.share > FLEXIBLE):
        return None
    return Unexplained(best.effect, rung, saved)


def strengths(inquiry: Inquiry, found: Unexplained) -> np.ndarray:
    """Return the field's fitted strengths."""
    n = len(inquiry.model.effects[found.field].parameters)
    effects = found.rung.revision.effects
    return inquiry.values(effects, found.rung.revision.fit.vector)[0, -n:]
