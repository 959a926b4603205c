"""A camera whose metre is not one."""

import numpy as np

from robotcast.effects.effect import Effect


class CameraScale(Effect):
    """Waypoints are (1 + k) times as far from the base as they were."""

    def seen(self, points_m: np.ndarray, *, k: np.ndarray) -> np.ndarray:
        return points_m * (1 + k[:, None])

    def unseen(self, points_m: np.ndarray, *, k: np.ndarray) -> np.ndarray:
        return points_m / (1 + k[:, None])
