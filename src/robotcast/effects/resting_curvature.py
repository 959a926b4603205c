"""A cable that is bent when nothing acts on it."""

import numpy as np

from robotcast.effects.effect import Effect
from robotcast.effects.motion import CableMotion


class RestingCurvature(Effect):
    """The bending springs rest at curvature κ, positive to the left."""

    def rest_curvature(self, cable: CableMotion, *, kappa: np.ndarray) -> np.ndarray:
        return kappa
