"""How much of a diagnosis is still to come, for a progress bar."""

from collections.abc import Mapping

STEPS: Mapping[str, float] = {  # how a step's note begins → the runs that a trial usually takes
    "fitting the model": 400.0,
    "looking at": 7.0,
    "refitting the model": 210.0,
    "refitting with": 110.0,
    "refitting the best": 88.0,
    "judging": 18.0,
    "trying a field": 7.0,
    "beginning with": 40.0,
    "fitting": 60.0,
    "refitting it": 25.0,
    "choosing": 18.0,
}
JUDGED = 2  # in one search for a further effect
BEGUN = 3  # fields fitted to beginnings
OTHER = 40.0


class Outlook:
    """Tells from the steps taken and those planned how many runs there will be in all.

    How much a step takes depends on the model; what the steps so far took, beside what they
    usually take, corrects the plan. Every effect that is found adds a round, so the total grows.
    """

    def __init__(self, trials: int, candidates: int, fields: int) -> None:
        self._trials, self._candidates = trials, candidates
        self._left = dict.fromkeys(STEPS, 1) | {
            "looking at": candidates,
            "judging": JUDGED,
            "trying a field": fields,
            "beginning with": BEGUN,
        }
        self._taken, self._now, self._before = 0.0, 0.0, 0

    def step(self, note: str, simulated: int) -> None:
        """Begin a step after so many runs."""
        self._taken, self._before = self._taken + self._now, simulated
        kind = next((kind for kind in STEPS if note.startswith(kind)), "")
        self._now = STEPS.get(kind, OTHER)
        if not kind:
            return
        if kind == "looking at" and not self._left[kind]:
            again = {"refitting the model": 1, "refitting with": 1, "refitting the best": 1}
            self._left |= again | {"judging": JUDGED, kind: self._candidates}
        earlier = list(STEPS)[: list(STEPS).index(kind)]
        self._left |= dict.fromkeys(earlier, 0)  # left out, if it has not come by now
        self._left[kind] = max(self._left[kind] - 1, 0)

    def total(self, simulated: int) -> int:
        """Return how many runs there will be in all."""
        pace = self._before / self._taken if self._before else float(self._trials)
        ahead = sum(STEPS[kind] * n for kind, n in self._left.items())
        now = max(self._before + pace * self._now, float(simulated))
        return max(int(now + pace * ahead), simulated + 1)
