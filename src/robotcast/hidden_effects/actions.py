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
    """

    actions: int
    repeated: int
    times: int

    def __post_init__(self) -> None:
        if not 0 <= self.repeated <= self.actions or self.actions < 1 or self.times < 1:
            raise ValueError(
                "hidden effects: expected 0 ≤ repeated ≤ actions and times ≥ 1, got "
                f"{self.repeated} of {self.actions} actions {self.times} times"
            )


def choose_actions(
    feasible: np.ndarray, counts: CastCounts, random: np.random.Generator
) -> list[tuple[int, Action]]:
    """Draw the casts (action_id, action) of a case from the feasible actions (m, 6).

    Half of the actions are mirrored, so that both sides of the board are seen. The repeats
    come last.
    """
    if counts.actions > len(feasible):
        raise ValueError(
            f"hidden effects: {counts.actions} actions wanted, {len(feasible)} are feasible"
        )
    rows = random.permutation(len(feasible))[: counts.actions]
    mirrored = random.permutation(counts.actions) < counts.actions // 2
    actions = [Action.from_array(feasible[row]) for row in rows]
    actions = [a.mirrored() if m else a for a, m in zip(actions, mirrored, strict=True)]
    again = np.repeat(np.arange(counts.repeated), counts.times - 1)
    return [(int(n), actions[n]) for n in (*range(counts.actions), *again)]
