"""A fit that is told which effects are missing: what any diagnosis could reach at best."""

from collections.abc import Mapping
from dataclasses import dataclass

from robotcast.diagnosis.errors import Floor, Gain
from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.rule import Effort
from robotcast.diagnosis.selection import Rung
from robotcast.hidden_effects.rivals.places import all_probes, joined
from robotcast.hidden_effects.rivals.refitting import (
    judged_refit,
    rematched,
    saving,
    settled,
)


@dataclass(frozen=True)
class Told:
    """The base model, the model with what is hidden, and what that saves on held-out trials."""

    base: Rung
    rung: Rung
    gain: Gain


def told(
    inquiry: Inquiry,
    base: Rung,
    hidden: Mapping[str, Mapping[str, float]],
    floor: Floor,
    effort: Effort,
) -> Told:
    """Fit the model with the hidden effects.

    Parameters
    ----------
    hidden : effect → its true parameters: one of the starts; null and the probes are others.
    """
    places = joined([all_probes(inquiry.model.effects[name]) for name in hidden])
    rung = judged_refit(inquiry, base, list(hidden), [hidden, *places], effort)
    rung = settled(inquiry, rung, effort)
    base = rematched(inquiry, base, rung, effort)
    return Told(base, rung, saving(inquiry, base, rung, floor))
