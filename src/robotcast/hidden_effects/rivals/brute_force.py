"""Refitting the model with every effect in turn, until none pays."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from robotcast.diagnosis.errors import Floor
from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.rule import Effort, Rule
from robotcast.diagnosis.selection import Rung
from robotcast.hidden_effects.rivals.places import all_probes
from robotcast.hidden_effects.rivals.refitting import (
    judged_refit,
    rematched,
    saving,
    settled,
)


@dataclass(frozen=True)
class Round:
    """Every effect tried on top of a model.

    Attributes
    ----------
    best : the one with the smallest held-out error.
    p_value : of its saving.
    tried : effect → its held-out waypoint error, % of the scale.
    kept : the model that goes on: with the best one if it pays, without it if not.
    simulated : trials that the round simulated.
    """

    best: str
    p_value: float
    tried: Mapping[str, float]
    kept: Rung
    simulated: int

    @property
    def paid(self) -> bool:
        """Whether the best effect was kept."""
        return self.best in self.kept.revision.effects


def brute_force(
    inquiry: Inquiry,
    base: Rung,
    candidates: Sequence[str],
    floor: Floor,
    rule: Rule,
    effort: Effort,
    tell: Callable[[str], object],
) -> Iterator[Round]:
    """Fit every candidate with all parameters from several starts; keep the best if it pays.

    So it goes on, round by round, as a diagnosis does: until nothing pays, nothing is left to
    explain, or there are as many effects as a diagnosis names at most.

    Parameters
    ----------
    tell : called with the name of each effect before it is fitted.
    """
    top = base
    for _ in range(rule.most_effects):
        left = [name for name in candidates if name not in top.revision.effects]
        tried = _round(inquiry, top, left, floor, rule, effort, tell)
        yield tried
        top = tried.kept
        if not tried.paid or not floor.above(top.errors.waypoint, 1.0):
            return


def _round(
    inquiry: Inquiry,
    top: Rung,
    candidates: Sequence[str],
    floor: Floor,
    rule: Rule,
    effort: Effort,
    tell: Callable[[str], object],
) -> Round:
    before = inquiry.simulated
    rungs: dict[str, Rung] = {}
    for name in candidates:
        tell(name)
        places = all_probes(inquiry.model.effects[name])
        rungs[name] = judged_refit(inquiry, top, [name], places, effort)
    tried = {name: float(rung.errors.waypoint.mean()) for name, rung in rungs.items()}
    best = min(tried, key=lambda name: tried[name])
    rung = settled(inquiry, rungs[best], effort)
    top = rematched(inquiry, top, rung, effort)
    saved = saving(inquiry, top, rung, floor)
    kept = rung if saved.pays(rule, len(candidates)) else top
    return Round(best, saved.p_value, tried, kept, inquiry.simulated - before)
