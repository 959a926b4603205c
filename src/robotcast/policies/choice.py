"""The policy: from a target to the action whose predicted endpoint is nearest to it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robotcast.casts.action import Action
from robotcast.policies.forward_model import Predictor

Feasible = Callable[[np.ndarray], np.ndarray]

OUT_OF_REACH_M = 0.03  # predicted miss from which on a target is said to be out of reach
_ASKED_FIRST = 4


@dataclass(frozen=True)
class Choice:
    """What a policy does for one target.

    Attributes
    ----------
    target_m, predicted_m : ndarray of shape (2,), the wanted and the predicted endpoint. For a
        target out of reach the latter is the nearest point that the policy can reach.
    """

    target_m: np.ndarray
    action: Action
    predicted_m: np.ndarray

    @property
    def miss_m(self) -> float:
        """How far from the target the model expects the cast to end."""
        return float(np.linalg.norm(self.predicted_m - self.target_m))

    @property
    def reachable(self) -> bool:
        """Whether the model expects the cast to end at the target or close by."""
        return self.miss_m <= OUT_OF_REACH_M

    def out_of_reach(self) -> str:
        """Say that the target cannot be reached, and where the cast is aimed instead."""
        (x, y), (near_x, near_y) = self.target_m, self.predicted_m
        return (
            f"({x:.2f}, {y:.2f}) m is out of reach; the nearest point within reach is "
            f"({near_x:.2f}, {near_y:.2f}) m, {100 * self.miss_m:.0f} cm away"
        )


def choose_actions(
    model: Predictor, candidates: np.ndarray, targets_m: np.ndarray, feasible: Feasible
) -> list[Choice]:
    """Choose π(s) = argmin over the feasible candidates of |f_forw(a) − s| for every target.

    Candidates come to rest mostly on one half of the board. A target on the other half gets the
    mirror image of the cast chosen for its mirror image (paper, "Parameterized Actions"); so the
    candidates are predicted once, whatever the number of targets. Whether the arm can do a
    candidate is asked for the nearest ones only, of all targets at once, until each has one;
    the choice is the same as if all had been asked for.

    Parameters
    ----------
    candidates : ndarray of shape (n, 6), in the order of `ACTION_COLUMNS`.
    targets_m : ndarray of shape (k, 2).
    feasible : tells which actions (m, 6) the arm can do, and their mirror images too.
    """
    predicted = model.predict(candidates)
    flips = mirror_flips(targets_m, rest_side(predicted))
    rows = _nearest(candidates, predicted, targets_m * flips, feasible)
    choices = []
    for target, row, flip in zip(targets_m, rows, flips, strict=True):
        action = Action.from_array(candidates[row])
        chosen = action.mirrored() if flip[1] < 0 else action
        choices.append(Choice(target, chosen, predicted[row] * flip))
    return choices


def rest_side(endpoints_m: np.ndarray) -> float:
    """Return +1 when most of `endpoints_m` (n, 2) lie on the left half (y > 0), −1 otherwise."""
    return 1.0 if np.median(endpoints_m[:, 1]) > 0 else -1.0


def mirror_flips(points_m: np.ndarray, side: float) -> np.ndarray:
    """Return (k, 2) factors that bring points (k, 2) to the half `side` of the board, and back."""
    across = np.where(points_m[:, 1] * side < 0, -1.0, 1.0)
    return np.stack([np.ones(len(points_m)), across], axis=1)


def _nearest(
    candidates: np.ndarray, predicted_m: np.ndarray, targets_m: np.ndarray, feasible: Feasible
) -> np.ndarray:
    """Return the row of the feasible candidate predicted nearest to each target, (k,)."""
    found = np.full(len(targets_m), -1)
    asked, size = 0, min(_ASKED_FIRST, len(candidates))
    while (open_ := np.flatnonzero(found < 0)).size:
        if asked == len(candidates):
            raise ValueError("no candidate action is feasible: widen the ranges of the action grid")
        rows = np.stack([_first(predicted_m, targets_m[k], size)[asked:] for k in open_])
        possible = feasible(candidates[rows.ravel()]).reshape(rows.shape)
        best = rows[np.arange(len(rows)), possible.argmax(axis=1)]
        found[open_] = np.where(possible.any(axis=1), best, -1)
        asked, size = size, min(4 * size, len(candidates))
    return found


def _first(points_m: np.ndarray, target_m: np.ndarray, count: int) -> np.ndarray:
    """Return the rows of the `count` points (n, 2) nearest to a target (2,), nearest first.

    Of points equally far the first rows come first, whatever `count` is.
    """
    squares = np.square(points_m - target_m).sum(axis=1)
    if count == len(squares):
        return np.argsort(squares, kind="stable")
    border = np.partition(squares, count - 1)[count - 1]
    within = np.flatnonzero(squares <= border)
    return within[np.argsort(squares[within], kind="stable")][:count]
