"""A cable that stays bent."""

import numpy as np

from robotcast.effects.effect import Effect
from robotcast.effects.motion import CableMotion


class PlasticBending(Effect):
    """Elastic to the yield curvature κy, perfectly plastic beyond.

    The resting curvature κr follows the curvature κ so that |κ − κr| ≤ κy. The parameter is
    1/κy, so that null is a cable that never yields.
    """

    def rest_curvature(self, cable: CableMotion, *, softness: np.ndarray) -> np.ndarray:
        kappa = cable.curvature
        rest = cable.memory.get("rest", np.zeros_like(kappa))
        yields = 1 / np.maximum(softness, 1e-12)
        cable.memory["rest"] = np.clip(rest, kappa - yields, kappa + yields)
        return cable.memory["rest"]
