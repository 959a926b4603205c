"""A camera that is turned about the base."""

import numpy as np

from robotcast.effects.effect import Effect


class CameraRotation(Effect):
    """Waypoints are turned about the base by φ, positive to the left."""

    def seen(self, points_m: np.ndarray, *, phi: np.ndarray) -> np.ndarray:
        cosine, sine, (x, y) = np.cos(phi), np.sin(phi), np.moveaxis(points_m, 2, 0)
        return np.stack([x * cosine - y * sine, y * cosine + x * sine], axis=2)

    def unseen(self, points_m: np.ndarray, *, phi: np.ndarray) -> np.ndarray:
        return self.seen(points_m, phi=-phi)
