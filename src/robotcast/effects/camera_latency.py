"""A camera that stamps its frames late."""

import numpy as np

from robotcast.effects.effect import Effect


class CameraLatency(Effect):
    """A waypoint stamped t shows where the end was at t − τ."""

    def seen_at(self, times_s: np.ndarray, *, tau: np.ndarray) -> np.ndarray:
        return times_s - tau
