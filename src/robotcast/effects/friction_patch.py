"""A place where the board rubs differently."""

import numpy as np

from robotcast.effects.effect import Effect
from robotcast.effects.motion import CableMotion


class FrictionPatch(Effect):
    """μ × (1 + k exp(−|p − p0|² / w²))."""

    def force(
        self, cable: CableMotion, *, k: np.ndarray, x0: np.ndarray, y0: np.ndarray, w: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        dx, dy = (cable.x - x0) / w, (cable.y - y0) / w
        extra = np.exp(-(dx * dx + dy * dy)) * cable.friction_n * -k
        return extra * cable.slip_x, extra * cable.slip_y
