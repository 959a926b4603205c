"""How an arm follows the motion it is told, learned from its logs.

Casts are simulated for tuning with the tool motions that were logged; those that nobody cast yet
are known by their plans alone. Between the two lies the arm: it comes late, rounds what is sharp
and may fall short. Any linear arm is an average over the recent past of what it was told; its
weights follow from the logs by least squares.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robotcast.casts.action import ToolMotion

PAST_S = 0.2  # an arm that is later than this is not followed
SMOOTHNESS = 1e-3  # of the weights: (1 mm that no such model explains / bends of 0.03) squared
BELIEVED_M = 0.02  # what an arm may do otherwise, and still have been told these plans
DECIMALS = 6
LEVER_M = 0.3  # makes an angle as weighty as a distance


@dataclass(frozen=True)
class Following:
    """An arm that takes a weighted mean of what it was told lately.

    Attributes
    ----------
    period_s : between two weights.
    weights : ndarray of shape (k,), of the motion told now, a period ago and so on.
    told_rms_m, followed_rms_m : how far logged tools lie from what was told, and from this model
        (root mean square).
    """

    period_s: float
    weights: np.ndarray
    told_rms_m: float
    followed_rms_m: float

    @property
    def believed(self) -> bool:
        """Whether the logged motions come from the plans at all; recorded casts may have others."""
        return self.followed_rms_m <= BELIEVED_M

    @property
    def lag_s(self) -> float:
        """How late the arm is at constant speed."""
        late_s = np.arange(len(self.weights)) * self.period_s
        return float(self.weights @ late_s / self.weights.sum())

    def motion(self, told: ToolMotion) -> ToolMotion:
        """Return what the tool does when it is told `told`, until it has come to rest."""
        after = np.arange(1, len(self.weights)) * self.period_s
        t_s = np.concatenate([told.t_s, told.t_s[-1] + after])
        start = told.pose[0]
        return ToolMotion(
            t_s, start + _past(told, t_s, self.period_s, len(self.weights)) @ self.weights
        )


def exact_following(period_s: float) -> Following:
    """Return an arm that does as it is told."""
    return Following(period_s, np.ones(1), 0.0, 0.0)


def fit_following(pairs: Sequence[tuple[ToolMotion, ToolMotion]], period_s: float) -> Following:
    """Return how an arm follows, from motions it was told and those it then made.

    Excursions from each motion's start are compared, so that a calibration that puts the board
    or the tool somewhere else does not count. Raises ValueError without any motion.

    Parameters
    ----------
    pairs : (told, made), both of time 0 at the start of the cast.
    """
    if not pairs:
        raise ValueError("there is no cast that tells how the arm follows its plans")
    count = round(PAST_S / period_s) + 1
    scale = np.array([1.0, 1.0, LEVER_M])
    past = np.concatenate(
        [
            (_past(told, made.t_s, period_s, count) * scale[:, None]).reshape(-1, count)
            for told, made in pairs
        ]
    )
    made = np.concatenate([((m.pose - m.pose[0]) * scale).ravel() for _, m in pairs])
    bends = np.diff(np.eye(count), 2, axis=0)
    square = past.T @ past + SMOOTHNESS * bends.T @ bends
    weights = np.linalg.lstsq(square, past.T @ made, rcond=None)[0]
    weights = weights.round(DECIMALS)  # sums on more threads differ by less
    return Following(period_s, weights, _rms(past[:, 0] - made), _rms(past @ weights - made))


def _past(told: ToolMotion, t_s: np.ndarray, period_s: float, count: int) -> np.ndarray:
    """Return excursions (n, 3, count) from the start that were told 0, 1, … periods before."""
    excursions = [told.at(t_s - k * period_s) - told.pose[0] for k in range(count)]
    return np.stack(excursions, axis=-1)


def _rms(away: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(away)) * 3))
