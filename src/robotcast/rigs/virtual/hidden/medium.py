"""What can be wrong with the medium: air that drags, a film that rubs.

MuJoCo's own medium gives the same forces, but differentiates them at every step and makes a
cast five times as slow; so they are written here (and compared with MuJoCo's in the tests).
"""

from dataclasses import dataclass

import numpy as np

from robotcast.rigs.virtual.hidden.effect import Pieces, Pushing

AIR_KG_M3 = 1.2
SMOOTH_BALL = 0.5


@dataclass(frozen=True)
class Air(Pushing):
    """Drag ½ ρ C A v² on every piece of a fuzzy cable, whatever its heading, A = 2 r l.

    The end is smooth and round: C = 0.5 on its own π r². It adds less than a per cent.
    """

    drag: float

    def force_n(self, pieces: Pieces) -> np.ndarray:
        area = self.drag * 2 * pieces.radius_m * pieces.length_m
        area[-1] = SMOOTH_BALL * np.pi * pieces.radius_m[-1] ** 2
        speed = np.sqrt(np.sum(pieces.velocity_m_s**2, axis=1))
        return -0.5 * AIR_KG_M3 * (area * speed)[:, None] * pieces.velocity_m_s


@dataclass(frozen=True)
class Oil(Pushing):
    """A film on the board that holds every piece back by c m v."""

    rate_1_s: float

    def force_n(self, pieces: Pieces) -> np.ndarray:
        return -self.rate_1_s * pieces.mass_kg[:, None] * pieces.velocity_m_s
