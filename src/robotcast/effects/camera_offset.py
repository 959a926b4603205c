"""A camera whose origin is beside the base."""

import numpy as np

from robotcast.effects.effect import Effect


class CameraOffset(Effect):
    """Waypoints are shifted by (dx, dy)."""

    def seen(self, points_m: np.ndarray, *, dx: np.ndarray, dy: np.ndarray) -> np.ndarray:
        return points_m + np.stack([dx, dy], axis=2)

    def unseen(self, points_m: np.ndarray, *, dx: np.ndarray, dy: np.ndarray) -> np.ndarray:
        return points_m - np.stack([dx, dy], axis=2)
