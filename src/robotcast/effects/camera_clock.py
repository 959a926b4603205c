"""A camera whose second is not one."""

import numpy as np

from robotcast.effects.effect import Effect


class CameraClock(Effect):
    """The camera's clock runs (1 + k) times as fast: a stamp t means t / (1 + k)."""

    def seen_at(self, times_s: np.ndarray, *, k: np.ndarray) -> np.ndarray:
        return times_s / (1 + k)
