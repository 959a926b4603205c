"""A lens whose distortion was not taken out, or not all of it."""

import numpy as np

from robotcast.effects.effect import Effect

ROUNDS = 20  # of the fixed-point iteration, each 2 |k| ρ² times as near


class LensDistortion(Effect):
    """Waypoints lie (1 + k ρ²) times as far from the picture's middle; ρ is that distance."""

    def seen(
        self, points_m: np.ndarray, *, k: np.ndarray, x0: np.ndarray, y0: np.ndarray
    ) -> np.ndarray:
        apart = points_m - np.stack([x0, y0], axis=-1)
        return points_m + k[..., None] * (apart**2).sum(axis=-1, keepdims=True) * apart

    def unseen(
        self, points_m: np.ndarray, *, k: np.ndarray, x0: np.ndarray, y0: np.ndarray
    ) -> np.ndarray:
        middle = np.stack([x0, y0], axis=-1)
        apart = found = points_m - middle
        for _ in range(ROUNDS):
            found = apart / (1 + k[..., None] * (found**2).sum(axis=-1, keepdims=True))
        return points_m + (found - apart)
