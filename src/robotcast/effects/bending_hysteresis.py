"""Dry friction inside the cable."""

import numpy as np

from robotcast.effects.effect import Effect
from robotcast.effects.motion import CableMotion

SLOW_PER_M_S = 5.0  # bending slower than this is regularised


class BendingHysteresis(Effect):
    """A Coulomb moment M in every hinge that opposes bending."""

    def bending_moment(self, cable: CableMotion, *, M: np.ndarray) -> np.ndarray:
        rate = cable.bending_rate
        return -M * rate / np.sqrt(rate * rate + SLOW_PER_M_S**2)
