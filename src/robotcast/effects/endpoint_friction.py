"""An endpoint that rubs differently from the cable."""

import numpy as np

from robotcast.effects.effect import Effect
from robotcast.effects.motion import CableMotion


class EndpointFriction(Effect):
    """μ of the endpoint × (1 + k)."""

    def force(self, cable: CableMotion, *, k: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        extra = cable.on_endpoint(-k * cable.friction_n[:, -1:])
        return extra * cable.slip_x, extra * cable.slip_y
