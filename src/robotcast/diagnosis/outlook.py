"""How much of a diagnosis is still to come, for a progress bar."""

from enum import Enum


class Step(Enum):
    """What a diagnosis does, one after another: its text, and the runs that a trial takes."""

    BASE = ("fitting the model as it is", 130)
    LIBRARY = ("fitting all effects at once", 170)
    BEGINNINGS = ("fitting beginnings with {}", 90)
    REFIT = ("refitting with {}", 50)
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
