"""The policy: from a target to the action whose cast is expected to end nearest to it."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from robotcast.casts.action import Action
from robotcast.policies.learning.forward_model import UncertainPredictor

ASKED_FIRST = 64  # candidates nearest to a target whose spread is asked for at once
OUT_OF_REACH_M = 0.03  # predicted miss from which on a target is said to be out of reach


@dataclass(frozen=True)
class Choice:
    """What a policy does for one target.

    Attributes
    ----------
    target_m, predicted_m : ndarray of shape (2,), the wanted and the predicted endpoint.
    spread_m : ndarray of shape (2,), standard deviations that the model expects of a cast's
        endpoint about the predicted one; NaN of a policy that says nothing of it.
    nearest_m : ndarray of shape (2,), the predicted endpoint of all candidates that is nearest
        to the target, be that cast as wild as it may; NaN of a policy without candidates.
    """

    target_m: np.ndarray
    action: Action
    predicted_m: np.ndarray
    spread_m: np.ndarray = field(default_factory=lambda: np.full(2, np.nan))
    nearest_m: np.ndarray = field(default_factory=lambda: np.full(2, np.nan))

    @property
    def miss_m(self) -> float:
        """How far from the target the model expects the cast to end."""
        return float(np.linalg.norm(self.predicted_m - self.target_m))

    @property
    def reachable(self) -> bool:
        """Whether the model expects any cast to end at the target or close by."""
        return float(np.linalg.norm(self._reached_m - self.target_m)) <= OUT_OF_REACH_M

    @property
    def _reached_m(self) -> np.ndarray:
        """The point nearest to the target that the model knows how to reach."""
        nearer = np.linalg.norm(self.nearest_m - self.target_m) < self.miss_m
        return self.nearest_m if nearer else self.predicted_m

    def out_of_reach(self) -> str:
        """Say that the target cannot be reached, and what can be instead."""
        (x, y), (near_x, near_y) = self.target_m, self._reached_m
        away_m = np.linalg.norm(self._reached_m - self.target_m)
        return (
            f"({x:.2f}, {y:.2f}) m is out of reach; the nearest point within reach is "
            f"({near_x:.2f}, {near_y:.2f}) m, {100 * away_m:.0f} cm away"
        )


def choose_actions(
    model: UncertainPredictor, candidates: np.ndarray, targets_m: np.ndarray, caution: float = 1.0
) -> list[Choice]:
    """Choose the candidate whose cast is expected to miss least, for every target.

    The paper's policy is π(s) = argmin |f_forw(a) − s|. Among thousands of candidates many are
    predicted to end at the target, and some of them are whip-like casts that end anywhere. What
    a cast misses by is expected to be |f_forw(a) − s|² + |σ(a)|² in the mean square, with the
    spread σ that the model expects; the least of that is chosen.

    Candidates come to rest mostly on one half of the board. A target on the other half gets the
    mirror image of the cast chosen for its mirror image (paper, "Parameterized Actions"); so the
    candidates are predicted once, in one batch, whatever the number of targets.

    Parameters
    ----------
    candidates : ndarray of shape (n, 6), in the order of `ACTION_COLUMNS`: what the arm can do,
        mirrored or not (`feasible_actions`).
    targets_m : ndarray of shape (k, 2).
    caution : weight of |σ|²; 0 for the paper's policy.
    """
    if not len(candidates):
        raise ValueError("there is no candidate action to choose from")
    predicted = model.predict(candidates)
    flips = mirror_flips(targets_m, rest_side(predicted))
    away = np.square(predicted - (targets_m * flips)[:, None]).sum(axis=2)
    scatter = _scatter(model, candidates, away, caution) if caution and len(away) else 0.0
    choices = []
    for target, flip, missed in zip(targets_m, flips, away, strict=True):
        row = int((missed + scatter).argmin())
        action = Action.from_array(candidates[row])
        chosen = action.mirrored() if flip[1] < 0 else action
        nearest_m = predicted[missed.argmin()] * flip
        choices.append(Choice(target, chosen, predicted[row] * flip, nearest_m=nearest_m))
    return choices


def _scatter(
    model: UncertainPredictor, candidates: np.ndarray, away: np.ndarray, caution: float
) -> np.ndarray:
    """Return `caution` times |σ|² of every candidate that a target may want, (n,), else infinity.

    A candidate that is predicted to miss by more than another one does with its scatter is never
    the best, so that most need not be asked for theirs.

    Parameters
    ----------
    away : ndarray of shape (k, n), squares of the predicted misses of k targets.
    """
    scatter = np.full(len(candidates), np.inf)

    def ask(rows: np.ndarray) -> None:
        if len(rows):
            scatter[rows] = caution * np.square(model.spread(candidates[rows])).sum(axis=1)

    nearest = min(ASKED_FIRST, len(candidates))
    ask(np.unique(away.argpartition(nearest - 1, axis=1)[:, :nearest]))
    best = (away + scatter).min(axis=1, keepdims=True)
    ask(np.flatnonzero((away < best).any(axis=0) & np.isinf(scatter)))
    return scatter


def with_spread(model: UncertainPredictor, choices: Sequence[Choice]) -> list[Choice]:
    """Say of every choice how sure the model is of its endpoint; mirror images are as sure."""
    if not choices:
        return []
    actions = [c.action if c.action.theta1_rad > 0 else c.action.mirrored() for c in choices]
    spreads = model.spread(np.stack([action.as_array() for action in actions]))
    return [replace(c, spread_m=spread) for c, spread in zip(choices, spreads, strict=True)]


def rest_side(endpoints_m: np.ndarray) -> float:
    """Return +1 when most of `endpoints_m` (n, 2) lie on the left half (y > 0), −1 otherwise."""
    return 1.0 if np.median(endpoints_m[:, 1]) > 0 else -1.0


def mirror_flips(points_m: np.ndarray, side: float) -> np.ndarray:
    """Return (k, 2) factors that bring points (k, 2) to the half `side` of the board, and back."""
    across = np.where(points_m[:, 1] * side < 0, -1.0, 1.0)
    return np.stack([np.ones(len(points_m)), across], axis=1)
