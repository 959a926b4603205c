"""A lens whose distortion was not taken out, or not all of it."""

import numpy as np

from robotcast.effects.effect import Effect

ROUNDS = 8  # of the fixed-point iteration, each at least |k| ρ² times as near


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
        found = points_m
        for _ in range(ROUNDS):
            found = points_m - (self.seen(found, k=k, x0=x0, y0=y0) - found)
        return found
