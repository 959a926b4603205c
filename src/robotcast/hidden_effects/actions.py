"""Which casts a case consists of."""

from dataclasses import dataclass

import numpy as np

from robotcast.casts.action import Action


@dataclass(frozen=True)
class CastCounts:
    """How many casts a case has.

    Attributes
    ----------
    actions : distinct actions.
    repeated, times : so many of them are cast so many times, to show the noise floor.
    alike : share of the feasible actions that they are drawn from: those nearest to one of them,
        all to one side of the board. 1 draws from all, to both sides.
    """

    actions: int
    repeated: int
    times: int
    alike: float = 1.0

    def __post_init__(self) -> None:
        if not 0 < self.alike <= 1:
            raise ValueError(f"hidden effects: expected 0 < alike ≤ 1, got {self.alike:g}")
        if not 0 <= self.repeated <= self.actions or self.actions < 1 or self.times < 1:
            raise ValueError(
                "hidden effects: expected 0 ≤ repeated ≤ actions and times ≥ 1, got "
                f"{self.repeated} of {self.actions} actions {self.times} times"
            )


def choose_actions(
    feasible: np.ndarray, counts: CastCounts, random: np.random.Generator
) -> list[tuple[int, Action]]:
    """Draw the casts (action_id, action) of a case from the feasible actions (m, 6).

    Where they need not be alike, half of them are mirrored. The repeats come last.
    """
    among = feasible if counts.alike == 1 else _alike(feasible, counts.alike, random)
    if counts.actions > len(among):
        raise ValueError(
            f"hidden effects: {counts.actions} actions wanted, {len(among)} are feasible"
        )
    rows = random.permutation(len(among))[: counts.actions]
    mirrored = random.permutation(counts.actions) < counts.actions // 2
    actions = [Action.from_array(among[row]) for row in rows]
    if counts.alike == 1:
        actions = [a.mirrored() if m else a for a, m in zip(actions, mirrored, strict=True)]
    again = np.repeat(np.arange(counts.repeated), counts.times - 1)
    return [(int(n), actions[n]) for n in (*range(counts.actions), *again)]


def _alike(feasible: np.ndarray, share: float, random: np.random.Generator) -> np.ndarray:
    """Return the share of the actions that is nearest to one of them, in shares of their ranges."""
    ranges = np.maximum(np.ptp(feasible, axis=0), 1e-9)
    centre = feasible[random.integers(len(feasible))]
    distance = np.linalg.norm((feasible - centre) / ranges, axis=1)
    return feasible[np.argsort(distance, kind="stable")[: round(share * len(feasible))]]
