"""What a search for the missing effects has found, models judged on trials held out, and its steps.

The steps tell how much is still to come, for a progress bar.
"""

from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from robotcast.diagnosis.errors import Gain, Scales
from robotcast.diagnosis.inquiry import HeldOut, Revision
from robotcast.diagnosis.library import Library
from robotcast.fitting.least_squares import Fit

Effects = tuple[str, ...]


@dataclass(frozen=True)
class Rung:
    """A model judged on trials held out: a rung of the error ladder."""

    revision: Revision
    errors: HeldOut
    gain: Gain | None = None  # over the base model

    @property
    def effects(self) -> Effects:
        """The effects that act."""
        return self.revision.effects


@dataclass(frozen=True)
class Found:
    """What a search found so far."""

    judged: dict[Effects, Rung] = field(default_factory=dict)  # the base model first
    chosen: Effects = ()  # of the model that the search ended with
    early: dict[Effects, Fit] = field(default_factory=dict)  # fits to beginnings
    library: Library | None = None  # the fit with all effects, None before it is done
    scales: Scales | None = None  # how errors are compared, None before the base model is known
    inseparable: bool = False  # whether the chosen effects only help together
    # effect of the chosen set → effects that do as well in its place
    rivals: dict[str, tuple[str, ...]] = field(default_factory=dict)
    # what is missed where nothing acts, (n_trials,), % of the scale; None if nobody can tell
    idle: np.ndarray | None = None

    def typical(self, rung: Rung) -> float:
        """Return a model's typical error, % of the scale."""
        return self.known_scales.typical(rung.errors.waypoint)

    def gain(self, before: Rung, after: Rung) -> Gain:
        """Return what one model saves over another."""
        return self.known_scales.gain(before.errors.waypoint, after.errors.waypoint)

    def predicts(self, rung: Rung) -> bool:
        """Tell whether a model predicts the trial in the middle better than if nothing acted.

        Beside a base model that does not, it must miss less than half: whatever slows a hopeless
        model down lowers its error, and explains nothing. Of trials at rest that nothing acts is
        right, so that they say little in a mean of logarithms.
        """
        if self.idle is None:
            return True
        errors = (self.idle, self.base.errors.waypoint, rung.errors.waypoint)
        idle, base, own = (float(np.median(one[self.known_scales.usual])) for one in errors)
        return own < (idle if base < idle else self.known_scales.rule.mostly * idle)

    def above(self, rung: Rung, times: float) -> bool:
        """Tell whether a model lies so many times above the floor."""
        scales = self.known_scales
        return scales.floor.above(rung.errors.waypoint[scales.usual], times)

    def enough(self, effects: Effects) -> list[Rung]:
        """Return parts of a set that are likely to help, to which the rest adds too little."""
        rule, whole = self.known_scales.rule, self.judged[effects]
        return [
            part
            for some, part in self.judged.items()
            if set(self.base.effects) < set(some) < set(effects)
            and self.predicts(part)
            and self.gain(self.base, part).promises(rule)
            and not self.gain(part, whole).matters(rule)
        ]

    @property
    def known_scales(self) -> Scales:
        """How errors are compared, once the base model is known."""
        assert self.scales is not None
        return self.scales

    @property
    def base(self) -> Rung:
        """The model as it is."""
        return next(iter(self.judged.values()))

    @property
    def top(self) -> Rung:
        """The model with the chosen effects."""
        return self.judged[self.chosen]

    @property
    def named(self) -> Effects:
        """The chosen effects beside those of the base model."""
        return self.chosen[len(self.base.effects) :]

    @property
    def near(self) -> tuple[Rung, ...]:
        """Judged models that promise to pay over the chosen one, the best first."""
        judged = {e: r for e, r in self.judged.items() if self.predicts(r)}
        larger = [r for effects, r in judged.items() if len(effects) > len(self.chosen)]
        rule = self.known_scales.rule
        hopeful = [rung for rung in larger if self.gain(self.top, rung).promises(rule)]
        return tuple(sorted(hopeful, key=self.typical))

    @property
    def ladder(self) -> tuple[Rung, ...]:
        """The base model, the best judged model on the way, and the chosen one."""
        if not self.judged:
            return ()
        rungs, fixed = [self.base], len(self.base.effects)
        for size in range(1, len(self.named) + 1):
            within = [
                rung
                for effects, rung in self.judged.items()
                if len(effects) == fixed + size
                and set(rungs[-1].effects) < set(effects)
                and set(effects) <= set(self.chosen)
            ]
            if within:
                rungs.append(min(within, key=lambda rung: rung.errors.waypoint.mean()))
        return tuple(rungs)


class Step(Enum):
    """What a diagnosis does, one after another: its text, and the runs that a trial takes."""

    BASE = ("fitting the model as it is", 180)
    LIBRARY = ("fitting all effects at once", 170)
    BEGINNINGS = ("fitting beginnings with {}", 90)
    REFIT = ("refitting with {}", 75)
    REMATCH = ("refitting the model as it is", 40)
    FIELDS = ("looking for a force of no name", 120)
    NEXT = ("choosing the next {}", 20)

    def says(self, what: str) -> str:
        """Return the text with what it is done to, effects by their readable names."""
        return self.value[0].format(what.replace("_", " "))

    @property
    def runs(self) -> int:
        """How many runs a trial takes."""
        return self.value[1]


SURE = (Step.BASE, Step.LIBRARY)  # the others come only where something seems to be missing


class Outlook:
    """Tells from the step that is under way how many runs there will be in all.

    Steps may come again, so the total may grow.
    """

    def __init__(self, trials: int) -> None:
        self._trials, self._before, self._step = trials, 0, Step.BASE

    def step(self, step: Step, simulated: int) -> None:
        """Begin a step after so many runs."""
        self._step, self._before = step, simulated

    def total(self, simulated: int) -> int:
        """Return how many runs there will be in all."""
        later = SURE[SURE.index(self._step) + 1 :] if self._step in SURE else ()
        ahead = self._step.runs + sum(step.runs for step in later)
        return max(self._before + self._trials * ahead, simulated + 1)
