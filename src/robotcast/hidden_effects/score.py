"""How well a diagnosis and the methods beside it did, over all cases."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from robotcast.hidden_effects.outcome import BruteForce, Intervals, Outcome

NONE, UNKNOWN = ("none",), ("unknown",)
METHODS = ("diagnosis", "random", "largest_sensitivity", "brute_force", "oracle")


@dataclass(frozen=True)
class Share:
    """So much of so many, both counts or both sums.

    Attributes
    ----------
    missing : cases that belong here and were not run.
    """

    part: float
    whole: float
    missing: int = 0

    @property
    def value(self) -> float | None:
        """The share, None of nothing."""
        return self.part / self.whole if self.whole else None


@dataclass(frozen=True)
class Criterion:
    """One line of the benchmark's result: what is asked, and what came.

    Attributes
    ----------
    rule, bound : whether the share shall be at least or at most `bound`; None: shown only.
    counted : the share is of cases or parameters, not of an amount.
    """

    name: str
    share: Share
    rule: Literal["least", "most"] = "least"
    bound: float | None = None
    counted: bool = True

    @property
    def met(self) -> bool | None:
        """Whether it is met; None when nothing is asked or nothing was run."""
        value = self.share.value
        if value is None or self.bound is None:
            return None
        return value >= self.bound if self.rule == "least" else value <= self.bound


def named_by(outcome: Outcome, method: str) -> tuple[str, ...] | None:
    """Return what a method says is hidden, most likely first; None when it was not run."""
    if method == "diagnosis":
        return outcome.diagnosis and outcome.diagnosis.verdict
    if method == "oracle":
        return outcome.oracle and (tuple(outcome.truth.effects) or NONE)
    if method == "brute_force":
        return outcome.brute_force and outcome.brute_force.effects
    one = getattr(outcome, method)
    return None if one is None else (one,)


def criteria(outcomes: Sequence[Outcome]) -> list[Criterion]:
    """Return what is asked of the diagnosis, with what came."""
    single = [o for o in outcomes if o.truth.kind == "single"]
    shown = [o for o in single if o.shows]
    told = [o for o in single if o.oracle is None]
    named = [o for o in outcomes if o.truth.kind in ("single", "pair")]
    hidden = [o for o in named if o.shows]
    outside = _of_kind(outcomes, "outside")
    top = top_one(shown, "diagnosis")
    return [
        Criterion(
            "named first, where the oracle's gain is significant",
            Share(top.part, top.whole, top.missing + len(told)),
            bound=0.9,
        ),
        Criterion("named first, all cases with one effect", top_one(single, "diagnosis")),
        Criterion(
            "false alarms on controls", false_alarms(outcomes, "diagnosis"), "most", bound=0.0
        ),
        Criterion("outside the library: unknown", _unknown(outside), bound=0.75),
        Criterion(
            "outside the library: a wrong name with a clean bill",
            _clean_bills(outside),
            "most",
            bound=0.0,
        ),
        Criterion("two effects: both named", both(outcomes, "diagnosis"), bound=0.75),
        Criterion("truth among the confusable", _confusable(shown), bound=0.95),
        Criterion(
            "held-out drop relative to the oracle's", _drop(hidden), bound=0.9, counted=False
        ),
        Criterion("intervals that cover the true size", coverage(named, covered), bound=0.85),
        Criterion(
            "intervals that cover the true size, of the oracle",
            coverage(named, covered_when_told),
        ),
        Criterion(
            "simulated casts relative to brute force",
            _casts(outcomes, lambda forced: forced.simulated_casts),
            "most",
            bound=0.25,
            counted=False,
        ),
        Criterion(
            "simulated casts relative to brute force that looks for one effect only",
            _casts(outcomes, lambda forced: forced.simulated_casts - forced.later_casts),
            "most",
            counted=False,
        ),
    ]


def top_one(outcomes: Iterable[Outcome], method: str) -> Share:
    """Return how many of the cases with one effect a method names first."""
    return _count(outcomes, method, lambda o, said: said[0] in o.truth.effects)


def false_alarms(outcomes: Iterable[Outcome], method: str) -> Share:
    """Return how many controls a method says something is hidden in."""
    return _count(_of_kind(outcomes, "control"), method, lambda _, said: said != NONE)


def both(outcomes: Iterable[Outcome], method: str) -> Share:
    """Return in how many cases with two effects a method names both."""
    pairs = _of_kind(outcomes, "pair")
    return _count(pairs, method, lambda o, said: set(o.truth.effects) <= set(said))


def _unknown(outcomes: Iterable[Outcome]) -> Share:
    return _count(outcomes, "diagnosis", lambda _, said: said == UNKNOWN)


def _clean_bills(outcomes: Iterable[Outcome]) -> Share:
    def clean(outcome: Outcome, said: tuple[str, ...]) -> bool:
        left_open = outcome.diagnosis is not None and outcome.diagnosis.unexplained
        return said not in (NONE, UNKNOWN) and not left_open

    return _count(outcomes, "diagnosis", clean)


def _confusable(outcomes: Iterable[Outcome]) -> Share:
    def held(outcome: Outcome, said: tuple[str, ...]) -> bool:
        among = outcome.diagnosis.confusable if outcome.diagnosis else frozenset()
        return set(outcome.truth.effects) <= among | set(said)

    return _count(outcomes, "diagnosis", held)


def _drop(outcomes: Sequence[Outcome]) -> Share:
    """Return by how much the diagnosis lowers the held-out errors, of what the oracle does."""
    own = [
        (o.diagnosis.base_percent - o.diagnosis.final_percent, o.oracle.drop_percent)
        for o in outcomes
        if o.diagnosis
        and o.oracle
        and o.diagnosis.base_percent is not None
        and o.diagnosis.final_percent is not None
    ]
    return Share(sum(d for d, _ in own), sum(d for _, d in own), len(outcomes) - len(own))


def covered(outcome: Outcome) -> list[bool]:
    """Return for every size of a hidden effect that was named whether its interval holds it."""
    if outcome.diagnosis is None:
        return []
    named = outcome.diagnosis.verdict
    return _held(outcome, outcome.diagnosis.intervals, named)


def covered_when_told(outcome: Outcome) -> list[bool]:
    """Return the same for the oracle, to whom every hidden effect is named."""
    if outcome.oracle is None:
        return []
    return _held(outcome, outcome.oracle.intervals, tuple(outcome.truth.effects))


def _held(outcome: Outcome, intervals: Intervals, named: tuple[str, ...]) -> list[bool]:
    return [
        intervals[key][0] <= size <= intervals[key][1]
        for key, size in outcome.truth.comparable_sizes.items()
        if key[0] in named and key in intervals
    ]


def coverage(outcomes: Iterable[Outcome], held: Callable[[Outcome], list[bool]]) -> Share:
    """Return how many intervals hold the true size, with `covered` or `covered_when_told`."""
    all_held = [one for outcome in outcomes for one in held(outcome)]
    return Share(sum(all_held), len(all_held))


def _casts(outcomes: Sequence[Outcome], counted: Callable[[BruteForce], int]) -> Share:
    """Return what a diagnosis simulates, of what is counted of brute force, where both were run."""
    pairs = [(o.diagnosis, o.brute_force) for o in outcomes if o.diagnosis and o.brute_force]
    own = sum(diagnosis.simulated_casts for diagnosis, _ in pairs)
    brute = sum(counted(forced) for _, forced in pairs)
    return Share(own, brute, len(outcomes) - len(pairs))


def _of_kind(outcomes: Iterable[Outcome], kind: str) -> list[Outcome]:
    return [o for o in outcomes if o.truth.kind == kind]


def _count(
    outcomes: Iterable[Outcome],
    method: str,
    good: Callable[[Outcome, tuple[str, ...]], bool],
) -> Share:
    said = [(o, named_by(o, method)) for o in outcomes]
    run = [(o, names) for o, names in said if names]
    return Share(sum(good(o, names) for o, names in run), len(run), len(said) - len(run))
