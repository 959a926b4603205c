"""What may be wrong with the camera: where it says that things are, and when."""

import numpy as np

from robotcast.effects.effect import Effect

ROUNDS = 20  # of the fixed-point iteration, each 2 |k| ρ² times as near


class CameraClock(Effect):
    """The camera's clock runs (1 + k) times as fast: a stamp t means t / (1 + k)."""

    def seen_at(self, times_s: np.ndarray, *, k: np.ndarray) -> np.ndarray:
        return times_s / (1 + k)


class CameraLatency(Effect):
    """A waypoint stamped t shows where the end was at t − τ."""

    def seen_at(self, times_s: np.ndarray, *, tau: np.ndarray) -> np.ndarray:
        return times_s - tau


class CameraOffset(Effect):
    """Waypoints are shifted by (dx, dy)."""

    def seen(self, points_m: np.ndarray, *, dx: np.ndarray, dy: np.ndarray) -> np.ndarray:
        return points_m + np.stack([dx, dy], axis=2)

    def unseen(self, points_m: np.ndarray, *, dx: np.ndarray, dy: np.ndarray) -> np.ndarray:
        return points_m - np.stack([dx, dy], axis=2)


class CameraRotation(Effect):
    """Waypoints are turned about the base by φ, positive to the left."""

    def seen(self, points_m: np.ndarray, *, phi: np.ndarray) -> np.ndarray:
        cosine, sine, (x, y) = np.cos(phi), np.sin(phi), np.moveaxis(points_m, 2, 0)
        return np.stack([x * cosine - y * sine, y * cosine + x * sine], axis=2)

    def unseen(self, points_m: np.ndarray, *, phi: np.ndarray) -> np.ndarray:
        return self.seen(points_m, phi=-phi)


class CameraScale(Effect):
    """Waypoints are (1 + k) times as far from the base as they were."""

    def seen(self, points_m: np.ndarray, *, k: np.ndarray) -> np.ndarray:
        return points_m * (1 + k[:, None])

    def unseen(self, points_m: np.ndarray, *, k: np.ndarray) -> np.ndarray:
        return points_m / (1 + k[:, None])


class LensDistortion(Effect):
    """Waypoints lie (1 + k ρ²) times as far from the picture's middle; ρ is that distance.

    As of a lens whose distortion was not taken out, or not all of it.
    """

    def seen(
        self, points_m: np.ndarray, *, k: np.ndarray, x0: np.ndarray, y0: np.ndarray
    ) -> np.ndarray:
        apart = points_m - np.stack([x0, y0], axis=-1)
        return points_m + k[..., None] * (apart**2).sum(axis=-1, keepdims=True) * apart

    def unseen(
        self, points_m: np.ndarray, *, k: np.ndarray, x0: np.ndarray, y0: np.ndarray
    ) -> np.ndarray:
        apart = found = points_m - np.stack([x0, y0], axis=-1)
        for _ in range(ROUNDS):
            found = apart / (1 + k[..., None] * (found**2).sum(axis=-1, keepdims=True))
        return points_m + (found - apart)
