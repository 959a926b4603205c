"""The policy: from a target to the action whose predicted endpoint is nearest to it."""

from dataclasses import dataclass

import numpy as np

from robotcast.casts.action import Action
from robotcast.policies.forward_model import Predictor


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


def choose_actions(model: Predictor, candidates: np.ndarray, targets_m: np.ndarray) -> list[Choice]:
    """Choose π(s) = argmin over the candidates of |f_forw(a) − s| for every target.

    Candidates come to rest mostly on one half of the board. A target on the other half gets the
    mirror image of the cast chosen for its mirror image (paper, "Parameterized Actions"); so the
    candidates are predicted once, whatever the number of targets.

    Parameters
    ----------
    candidates : ndarray of shape (n, 6), feasible actions in the order of `ACTION_COLUMNS`.
    targets_m : ndarray of shape (k, 2).
    """
    if len(candidates) == 0:
        raise ValueError("no candidate action is feasible: widen the ranges of the action grid")
    predicted = model.predict(candidates)
    side = rest_side(predicted)
    return [_nearest(candidates, predicted, target, side) for target in targets_m]


def rest_side(endpoints_m: np.ndarray) -> float:
    """Return +1 when most of `endpoints_m` (n, 2) lie on the left half (y > 0), −1 otherwise."""
    return 1.0 if np.median(endpoints_m[:, 1]) > 0 else -1.0


def _nearest(
    candidates: np.ndarray, predicted_m: np.ndarray, target_m: np.ndarray, side: float
) -> Choice:
    flip = np.array([1.0, -1.0 if target_m[1] * side < 0 else 1.0])
    row = int(np.argmin(np.linalg.norm(predicted_m - target_m * flip, axis=1)))
    action = Action.from_array(candidates[row])
    return Choice(target_m, action.mirrored() if flip[1] < 0 else action, predicted_m[row] * flip)
