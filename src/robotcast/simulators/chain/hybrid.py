"""The hybrid cable: a soft rod with a rigid endpoint, dragged by the logged tool.

Paper, "Three Simulation Models", in MuJoCo. One Young's modulus E sets bending and stretching
of the round rod: the bending moment is E I κ and the tension E A ε, I = π r⁴/4 and A = π r².
Both have the same small material damping: σ = E (ε + η dε/dt) (Kelvin–Voigt).

The rod is cut into segments. Each has a hinge with the spring E I / l, and a slide along itself
with the spring E A / l, l the length of cable that bends or stretches there. Springs in joints,
not between mass points, because MuJoCo integrates the joints' damping implicitly: a damping of
half a step times the spring is what an implicit rule would add, so that a rod with η ≥ h/2 is
stable at a step h of 4 ms however stiff it is. A rod of mass points, as MuJoCo's flex makes it,
needs steps below 2/ω of its stiffest spring: 0.5 ms at E = 0.2 MPa and 0.2 ms at 1 MPa.
"""

import numpy as np

from robotcast.simulators.chain.run import ChainRun
from robotcast.simulators.chain.simulator import ChainSimulator

PARAMETERS = ("youngs_modulus_pa", "friction", "endpoint_mass_kg")


class _HybridRun(ChainRun):
    """One batch of rods with a spring and a damper in every hinge and slide."""

    def _set_parameters(self, vectors: np.ndarray) -> None:
        modulus, friction, endpoint_kg = vectors.T
        self._place_masses(np.full(len(vectors), self._cable.mass_kg), endpoint_kg, friction)
        area = np.pi * self._cable.radius_m**2
        inertia = 0.25 * np.pi * self._cable.radius_m**4
        bending = modulus[:, None] * inertia / self._geometry.bends_m
        self._set_springs(bending, modulus * area)
        damping_s = self._settings.stretch_damping_s + self._effects.damping_s()
        self._damping[:, self._hinges] = damping_s * bending


class HybridSimulator(ChainSimulator):
    """A soft rod with a rigid endpoint in the plane, in `mujoco.batch`.

    Its parameters: Young's modulus of the rod, planar friction μ and the endpoint's mass. The
    rod's length, radius and mass are taken as measured.
    """

    name = "hybrid"
    own = PARAMETERS
    run = _HybridRun
