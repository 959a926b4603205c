"""Friction that changes as the session goes on."""

import numpy as np

from robotcast.effects.effect import Effect
from robotcast.effects.motion import CableMotion


class FrictionDrift(Effect):
    """μ × (1 + k o): o grows from 0 at the session's first cast to 1 at its last."""

    factor = "order"

    def in_cast(self, factor: np.ndarray, *, k: np.ndarray) -> dict[str, np.ndarray]:
        return {"k": k * np.nan_to_num(factor, nan=1.0)}  # a cast to come is as the last

    def force(self, cable: CableMotion, *, k: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        extra = -k * cable.friction_n
        return extra * cable.slip_x, extra * cable.slip_y
