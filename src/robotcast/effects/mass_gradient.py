"""A cable that is heavier at one end."""

import numpy as np

from robotcast.effects.effect import Effect


class MassGradient(Effect):
    """Mass per length × (1 + k s), s from −1 at the hand to 1 at the free end."""

    def mass_factor(self, along: np.ndarray, *, k: np.ndarray) -> np.ndarray:
        return 1 + k * along
