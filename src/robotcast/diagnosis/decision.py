"""The verdict: one rule, as docs/decision.md states it."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum

from robotcast.diagnosis.errors import Floor
from robotcast.diagnosis.rule import Rule
from robotcast.diagnosis.selection import Found, Rung
from robotcast.diagnosis.unexplained import Unexplained


class Code(Enum):
    """What a verdict says."""

    NONE = "none"
    NAMED = "named"
    UNKNOWN = "unknown"
    CANNOT_TELL = "cannot tell"


@dataclass(frozen=True)
class Verdict:
    """What is missing.

    Attributes
    ----------
    named : the effects that are, when the code says so.
    near : models that promise to predict better, unconfirmed; the best first.
    left : what stays above the floor and what it is like; None where nothing does.
    """

    code: Code
    named: tuple[str, ...] = ()
    near: tuple[Rung, ...] = ()
    left: Unexplained | None = None

    @property
    def words(self) -> list[str]:
        """The verdict as `diagnosis.json` has it: effect ids, or "none", or "unknown"."""
        if self.named:
            return list(self.named)
        return ["unknown" if self.code is Code.UNKNOWN else "none"]


def decide(found: Found, floor: Floor, rule: Rule, look: Callable[[], Unexplained]) -> Verdict:
    """Decide what a search found.

    Parameters
    ----------
    look : looks for the force of no name that the base model lacks.
    """
    top, scales = found.top, found.scales
    assert scales is not None
    near = _near(found, rule)
    named = found.named
    if not named and floor.percent is None:
        return Verdict(Code.CANNOT_TELL, (), near)
    if not _worth_a_look(found, floor, rule):
        code = Code.NAMED if named else Code.NONE
        return Verdict(code, named, () if named else near)
    left = look()
    unfinished = floor.above(top.errors.waypoint[scales.usual], rule.at_floor)
    if not named:
        far = floor.above(top.errors.waypoint[scales.usual], rule.beyond)
        if left.enough or far:
            return Verdict(Code.UNKNOWN, (), near, left)
        return Verdict(Code.NONE, (), near, Unexplained() if unfinished else None)
    if _refuted(found, floor, left, rule):
        return Verdict(Code.UNKNOWN, (), (top,), left)
    if unfinished and _explained(found, floor) < rule.mostly:
        return Verdict(Code.UNKNOWN, (), (top,), left)
    return Verdict(Code.NAMED, named, (), Unexplained() if unfinished else None)


def _refuted(found: Found, floor: Floor, left: Unexplained, rule: Rule) -> bool:
    """Tell whether a field alone takes away most of what the named effects leave above the floor.

    Effects that imitate what is missing do less than a force like it.
    """
    scales, top = found.scales, found.top.errors.waypoint
    assert scales is not None
    if left.rung is None:
        return False
    excess = scales.typical(top) - max(floor.typical, floor.unit)
    beside = replace(scales, base=max(excess, 0.0), finished=math.inf)
    gain = beside.gain(top, left.rung.errors.waypoint)
    return gain.share > rule.mostly and gain.p_value < rule.level / left.tried


def _worth_a_look(found: Found, floor: Floor, rule: Rule) -> bool:
    """Tell whether the model misses more than repeats differ by, by what would matter."""
    scales, errors = found.scales, found.top.errors.waypoint
    assert scales is not None
    return floor.above(errors[scales.usual], 1 + rule.material)


def _explained(found: Found, floor: Floor) -> float:
    """Return the share of what the base model misses beyond the floor that the top one does not."""
    scales = found.scales
    assert scales is not None
    before, after = (scales.typical(r.errors.waypoint) for r in (found.base, found.top))
    return (before - after) / max(before - max(floor.typical, floor.unit), 1e-12)


def _near(found: Found, rule: Rule) -> tuple[Rung, ...]:
    """Return judged models that promise to pay over the chosen one, the best first."""
    scales, top = found.scales, found.top
    assert scales is not None
    hopeful = [
        rung
        for effects, rung in found.judged.items()
        if len(effects) > len(found.chosen)
        and scales.gain(top.errors.waypoint, rung.errors.waypoint).promises(rule)
    ]
    return tuple(sorted(hopeful, key=lambda rung: scales.typical(rung.errors.waypoint)))
