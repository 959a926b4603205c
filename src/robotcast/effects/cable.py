"""What the cable's material may do: bend, stay bent, damp; and how its mass lies along it."""

import numpy as np

from robotcast.effects.effect import CableMotion, Effect

SLOW_PER_M_S = 5.0  # bending slower than this is regularised


class BendingDamping(Effect):
    """A bending moment E I η dκ/dt: the material answers late (Kelvin–Voigt)."""

    def damping_time(self, *, eta: np.ndarray) -> np.ndarray:
        return eta


class BendingHysteresis(Effect):
    """A Coulomb moment M in every hinge that opposes bending."""

    def bending_moment(self, cable: CableMotion, *, M: np.ndarray) -> np.ndarray:
        rate = cable.bending_rate
        return -M * rate / np.sqrt(rate * rate + SLOW_PER_M_S**2)


class RestingCurvature(Effect):
    """The bending springs rest at curvature κ, positive to the left."""

    def rest_curvature(self, cable: CableMotion, *, kappa: np.ndarray) -> np.ndarray:
        return kappa


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


class MassGradient(Effect):
    """Mass per length × (1 + k s), s from −1 at the hand to 1 at the free end."""

    def mass_factor(self, along: np.ndarray, *, k: np.ndarray) -> np.ndarray:
        return 1 + k * along
