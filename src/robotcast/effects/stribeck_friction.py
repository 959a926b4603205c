"""Friction that is stronger in slow motion."""

import numpy as np

from robotcast.effects.effect import Effect
from robotcast.effects.motion import CableMotion


class StribeckFriction(Effect):
    """μ × (1 + k exp(−(|v| / vs)²))."""

    def force(
        self, cable: CableMotion, *, k: np.ndarray, vs: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        square = (cable.vx * cable.vx + cable.vy * cable.vy) / (vs * vs)
        extra = np.exp(-square) * cable.friction_n * -k
        return extra * cable.slip_x, extra * cable.slip_y
