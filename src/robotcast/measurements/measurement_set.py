"""What was told to a rig and what was seen, in memory, and splits of it by action."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from robotcast.casts.action import Action, ToolMotion, action_factors

STILL_M = 0.001  # a tool that has moved less than this has not dragged the free end yet


@dataclass(frozen=True)
class Cable:
    """A cable as its owner measured it."""

    name: str
    length_m: float
    mass_kg: float
    radius_m: float
    endpoint_mass_kg: float


@dataclass(frozen=True)
class Trial:
    """One cast that was executed and tracked."""

    trial: int
    action_id: int  # shared by casts that repeat an action
    action: Action
    tool: ToolMotion  # what the held end really did
    waypoints_s: np.ndarray  # (k,), of the tracked waypoints; lost frames are gaps
    waypoints_m: np.ndarray  # (k, 2), the tracked free end in the robot base's frame
    # further numbers that were logged with the cast; "order": its place in the session, 0 to 1
    logged: Mapping[str, float] = field(default_factory=dict)
    rested: bool = True  # where the free end was seen last is where the cast ended

    @property
    def factors(self) -> dict[str, float]:
        """What is known of the cast: the numbers of its action, and what was logged with it."""
        return {**self.logged, **action_factors(self.action.as_array())}

    @property
    def start_m(self) -> np.ndarray | None:
        """Where the free end was seen before the tool moved, (2,), None when it was not.

        The reset leaves the cable some millimetres to one side; starting there takes that
        scatter out of a prediction.
        """
        moved = np.linalg.norm(self.tool.pose[:, :2] - self.tool.pose[0, :2], axis=1) > STILL_M
        still_until = self.tool.t_s[moved.argmax()] if moved.any() else np.inf
        before = self.waypoints_s <= still_until
        return self.waypoints_m[before].mean(axis=0) if before.any() else None

    @property
    def endpoint_m(self) -> np.ndarray:
        """Where the free end was seen last, (2,): where the cast ended, if it `rested`."""
        return self.waypoints_m[-1]


@dataclass(frozen=True)
class MeasurementSet:
    """A set of casts with one cable on one rig."""

    cable: Cable
    r0_m: float
    period_s: float
    noise_m: float | None  # standard deviation of one tracked coordinate, None when unknown
    trials: tuple[Trial, ...]
    rig: str = "recorded"  # as every table names it
    tool_planned: bool = False  # not logged; the planned motion stands in for it
    notices: tuple[str, ...] = ()  # what a stage must tell before it uses the set

    @property
    def rested(self) -> "MeasurementSet":
        """The set with only the casts whose endpoints count."""
        return replace(self, trials=tuple(t for t in self.trials if t.rested))

    def select(self, trials: Iterable[int]) -> "MeasurementSet":
        """Return the set with only the given trial numbers, in this set's order."""
        wanted = set(trials)
        return replace(self, trials=tuple(t for t in self.trials if t.trial in wanted))

    def spread(self, n: int) -> "MeasurementSet":
        """Return the set with at most `n` of its trials, evenly spaced."""
        kept = np.linspace(0, len(self.trials), min(n, len(self.trials)), endpoint=False)
        return replace(self, trials=tuple(self.trials[int(i)] for i in kept))


def split_by_action(
    measured: MeasurementSet, n_first: int, n_second: int, seed: int
) -> tuple[MeasurementSet, MeasurementSet]:
    """Draw two disjoint sets of `n_first` and `n_second` casts, or refuse too few (ValueError).

    All repeats of an action go to one side or are left out together. Actions with many repeats
    are placed first, each by chance in proportion to the room that is left; a side stays below
    its number only where no placing of the repeats fills it.
    """
    if n_first < 1 or n_second < 1:
        raise ValueError(f"both sides of a split need casts, asked for {n_first} and {n_second}")
    n_left_out = len(measured.trials) - n_first - n_second
    if n_left_out < 0:
        raise ValueError(
            f"the split needs {n_first} + {n_second} casts, the set has {len(measured.trials)}"
        )
    repeats: dict[int, list[int]] = {}
    for trial in sorted(measured.trials, key=lambda t: t.trial):
        repeats.setdefault(trial.action_id, []).append(trial.trial)
    rng = np.random.default_rng(seed)
    drawn = rng.permutation(sorted(repeats)).tolist()
    sides: list[list[int]] = [[], [], []]
    room = np.array([n_first, n_second, n_left_out])
    for action_id in sorted(drawn, key=lambda drawn_id: -len(repeats[drawn_id])):
        casts = repeats[action_id]
        fits = np.where(room >= len(casts), room, 0)
        if fits.any():
            side = int(rng.choice(3, p=fits / fits.sum()))
            sides[side].extend(casts)
            room[side] -= len(casts)
    first, second, _ = sides
    if not first or not second:
        most = max(len(casts) for casts in repeats.values())
        raise ValueError(
            f"no split into {n_first} + {n_second} casts keeps the repeats of an action "
            f"together; the set has {len(repeats)} actions with up to {most} casts"
        )
    return measured.select(first), measured.select(second)
