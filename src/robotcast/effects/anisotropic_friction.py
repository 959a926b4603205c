"""Friction that differs along and across the cable."""

import numpy as np

from robotcast.effects.effect import Effect
from robotcast.effects.motion import CableMotion


class AnisotropicFriction(Effect):
    """Coulomb friction (1 + a) times as strong across the cable as along it."""

    def force(self, cable: CableMotion, *, a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        # the endpoint is round: it has no along and across
        across = cable.slip_y * cable.tx - cable.slip_x * cable.ty
        across[:, -1] = 0
        extra = -a * cable.friction_n * across
        return -extra * cable.ty, extra * cable.tx
