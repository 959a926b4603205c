"""Friction that differs along and across the cable."""

import numpy as np

from robotcast.effects.effect import Effect
from robotcast.effects.motion import CableMotion


class AnisotropicFriction(Effect):
    """Coulomb friction (1 + a) times as strong across the cable as along it, the endpoint's too."""

    def force(self, cable: CableMotion, *, a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        across = cable.slip_y * cable.tx - cable.slip_x * cable.ty
        extra = -a * cable.friction_n * across
        return -extra * cable.ty, extra * cable.tx
