"""A cable that slides out of the gripper."""

import numpy as np

from robotcast.effects.effect import Effect

SHARP_M_S = 0.02  # over which the slip sets in, so that a fit can find the speed


class CableSlip(Effect):
    """In casts faster than v the cable has slid out of the gripper and is longer by s."""

    factor = "vmax"

    def in_cast(self, factor: np.ndarray, *, s: np.ndarray, v: np.ndarray) -> dict[str, np.ndarray]:
        faster = np.clip((np.nan_to_num(factor) - v) / SHARP_M_S, -30, 30)
        return {"s": s / (1 + np.exp(-faster))}

    def extra_length(self, *, s: np.ndarray) -> np.ndarray:
        return s
