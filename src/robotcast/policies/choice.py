"""The policy: from a target to the action whose predicted endpoint is nearest to it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robotcast.casts.action import Action
from robotcast.policies.forward_model import Predictor

Feasible = Callable[[np.ndarray], np.ndarray]

_ASKED_FIRST = 32


@dataclass(frozen=True)
class Choice:
    """What a policy does for one target.

    Attributes
    ----------
    target_m, predicted_m : ndarray of shape (2,), the wanted and the predicted endpoint.
    """

    target_m: np.ndarray
    action: Action
    predicted_m: np.ndarray


def choose_actions(
    model: Predictor, candidates: np.ndarray, targets_m: np.ndarray, feasible: Feasible
) -> list[Choice]:
    """Choose π(s) = argmin over the feasible candidates of |f_forw(a) − s| for every target.

    Candidates come to rest mostly on one half of the board. A target on the other half gets the
    mirror image of the cast chosen for its mirror image (paper, "Parameterized Actions"); so the
    candidates are predicted once, whatever the number of targets. Whether the arm can do a
    candidate is asked for the nearest ones only, until one is found; the choice is the same as
    if all had been asked for.

    Parameters
    ----------
    candidates : ndarray of shape (n, 6), in the order of `ACTION_COLUMNS`.
    targets_m : ndarray of shape (k, 2).
    feasible : tells which actions (m, 6) the arm can do, and their mirror images too.
    """
    predicted = model.predict(candidates)
    side = rest_side(predicted)
    choices = []
    for target in targets_m:
        flip = np.array([1.0, -1.0 if target[1] * side < 0 else 1.0])
        row = _nearest(candidates, predicted, target * flip, feasible)
        action = Action.from_array(candidates[row])
        chosen = action.mirrored() if flip[1] < 0 else action
        choices.append(Choice(target, chosen, predicted[row] * flip))
    return choices


def rest_side(endpoints_m: np.ndarray) -> float:
    """Return +1 when most of `endpoints_m` (n, 2) lie on the left half (y > 0), −1 otherwise."""
    return 1.0 if np.median(endpoints_m[:, 1]) > 0 else -1.0


def _nearest(
    candidates: np.ndarray, predicted_m: np.ndarray, target_m: np.ndarray, feasible: Feasible
) -> int:
    """Return the row of the feasible candidate that is predicted nearest to the target (2,)."""
    order = np.argsort(np.linalg.norm(predicted_m - target_m, axis=1), kind="stable")
    start, size = 0, _ASKED_FIRST
    while start < len(order):
        rows = order[start : start + size]
        possible = rows[feasible(candidates[rows])]
        if len(possible):
            return int(possible[0])
        start, size = start + size, 4 * size
    raise ValueError("no candidate action is feasible: widen the ranges of the action grid")
