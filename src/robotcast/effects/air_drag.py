"""Drag of the air."""

import numpy as np

from robotcast.effects.effect import Effect
from robotcast.effects.motion import CableMotion

AIR_KG_M3 = 1.2


class AirDrag(Effect):
    """f = −½ ρ C A |v| v: A is a piece's side area 2 r l, of the endpoint its frontal area π r²."""

    def force(self, cable: CableMotion, *, C: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        radius = cable.cable.radius_m
        area = np.append(2 * radius * cable.lengths_m, np.pi * radius**2).astype(np.float32)
        drag = np.sqrt(cable.vx * cable.vx + cable.vy * cable.vy)
        drag *= (-0.5 * AIR_KG_M3) * C * area
        return drag * cable.vx, drag * cable.vy
