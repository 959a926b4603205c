"""Viscous damping inside the cable."""

import numpy as np

from robotcast.effects.effect import Effect


class BendingDamping(Effect):
    """A bending moment E I η dκ/dt: the material answers late (Kelvin–Voigt)."""

    def damping_time(self, *, eta: np.ndarray) -> np.ndarray:
        return eta
