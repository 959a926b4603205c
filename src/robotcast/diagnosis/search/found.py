"""What a search for missing effects found, and how hard it tries."""

from dataclasses import dataclass, field

from robotcast.diagnosis.revision import HeldOut, Revision
from robotcast.diagnosis.search.gain import Gain
from robotcast.diagnosis.search.screen import Screened


@dataclass(frozen=True)
class Rung:
    """One rung of the error ladder: a revision with its held-out errors."""

    revision: Revision
    errors: HeldOut
    predicted: float | None = None
    gain: Gain | None = None


@dataclass(frozen=True)
class Found:
    """What a search found so far.

    Attributes
    ----------
    ladder : the base, then a rung for every effect that paid.
    screens : of every round, effect → what the first look said.
    refits : effect → its rung on top of the ladder of its round, whether or not it paid.
    rivals : effect of the ladder → effects that do as well in its place.
    """

    ladder: tuple[Rung, ...] = ()
    screens: tuple[dict[str, Screened], ...] = ()
    refits: dict[str, Rung] = field(default_factory=dict)
    rivals: dict[str, tuple[str, ...]] = field(default_factory=dict)


@dataclass(frozen=True)
class Effort:
    """How hard a search tries: iterations of fits on all trials and without a fold."""

    base: int = 6
    refit: int = 3
    fold: int = 1
    seed: int = 0
