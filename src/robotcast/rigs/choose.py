"""Which casts to collect, and under which ids."""

from collections.abc import Sequence

import numpy as np

from robotcast.casts.action import Action
from robotcast.sessions.session import CastRequest

REPEATS_OF_ONE = 3
FIRST_FURTHER = 5_000  # ids of actions that are of no grid, which numbers its own from 0


def choose_casts(
    actions: np.ndarray, casts: int, repeats: int, seed: int
) -> list[tuple[int, Action]]:
    """Choose what to collect of the feasible actions (m, 6): a random part, some of it again.

    The choice for fewer casts is contained in the choice for more.

    Parameters
    ----------
    casts : distinct actions, all of them when there are no more.
    repeats : further casts; they repeat the first of the chosen actions, three times each.
    """
    order = np.random.default_rng(seed).permutation(len(actions))[:casts]
    again = np.repeat(order, REPEATS_OF_ONE)[:repeats]
    return [(int(row), Action.from_array(actions[row])) for row in (*order, *again)]


def number_further(
    actions: Sequence[Action], casts: Sequence[CastRequest]
) -> list[tuple[int, Action]]:
    """Give actions that are of no grid the ids under which a session of `casts` may hold them.

    An action that the session was asked for before keeps its id, so that a call that was cut
    off can go on; one that stands there twice is cast twice.
    """
    known = {c.action: c.action_id for c in casts if c.action_id >= FIRST_FURTHER}
    new = max(known.values(), default=FIRST_FURTHER - 1) + 1
    for action in actions:
        if action not in known:
            known[action] = new
            new += 1
    return [(known[action], action) for action in actions]
