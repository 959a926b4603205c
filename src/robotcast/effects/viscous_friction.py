"""Friction that grows with speed."""

import numpy as np

from robotcast.effects.effect import Effect
from robotcast.effects.motion import CableMotion


class ViscousFriction(Effect):
    """f = −c m v on every point, as of a lubricated board."""

    def force(self, cable: CableMotion, *, c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        drag = -c * cable.mass_kg
        return drag * cable.vx, drag * cable.vy
