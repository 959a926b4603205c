"""Refitting the model with every effect in turn."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.search.floor import Floor
from robotcast.diagnosis.search.found import Effort, Rung
from robotcast.hidden_effects.rivals.places import all_probes
from robotcast.hidden_effects.rivals.refitting import (
    judged_refit,
    rematched,
    saving,
    settled,
)


@dataclass(frozen=True)
class Forced:
    """What brute force found.

    Attributes
    ----------
    effect : the one with the smallest held-out error, or "none" if it does not pay.
    percent : held-out waypoint error of what was kept, % of the scale.
    p_value : of the best effect's saving over the base model.
    tried : effect → its held-out waypoint error, % of the scale.
    """

    effect: str
    percent: float
    p_value: float
    tried: Mapping[str, float]


def brute_force(
    inquiry: Inquiry,
    base: Rung,
    candidates: Sequence[str],
    floor: Floor,
    effort: Effort,
    tell: Callable[[str], object],
) -> Forced:
    """Fit every candidate with all parameters from several starts; keep the best if it pays.

    Parameters
    ----------
    tell : called with the name of each effect before it is fitted.
    """
    rungs: dict[str, Rung] = {}
    for name in candidates:
        tell(name)
        places = all_probes(inquiry.model.effects[name])
        rungs[name] = judged_refit(inquiry, base, [name], places, effort)
    tried = {name: float(rung.errors.waypoint.mean()) for name, rung in rungs.items()}
    best = min(tried, key=lambda name: tried[name])
    rung = settled(inquiry, rungs[best], effort)
    base = rematched(inquiry, base, rung, effort)
    saved = saving(inquiry, base, rung, floor)
    kept, named = (rung, best) if saved.pays else (base, "none")
    return Forced(named, float(kept.errors.waypoint.mean()), saved.p_value, tried)
