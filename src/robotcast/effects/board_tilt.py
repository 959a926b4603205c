"""A board that is not level."""

import numpy as np

from robotcast.effects.effect import Effect
from robotcast.effects.motion import CableMotion

GRAVITY_M_S2 = 9.81


class BoardTilt(Effect):
    """f = m g (sx, sy): the slopes along x and y, positive where things slide to +x and +y."""

    def force(
        self, cable: CableMotion, *, sx: np.ndarray, sy: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        weight = GRAVITY_M_S2 * cable.mass_kg
        return weight * sx, weight * sy
