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

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robotcast.effects.effect import Effect
from robotcast.fitting.parameter import Parameter
from robotcast.measurements.measurement_set import Cable
from robotcast.simulators.chain_run import ChainRun, ChainSettings
from robotcast.simulators.chain_simulator import ChainSimulator
from robotcast.simulators.chain_state import ChainState
from robotcast.simulators.rod_state import HINGES, SLIDES, apply_rod_forces, rod_state

PARAMETERS = ("youngs_modulus_pa", "friction", "endpoint_mass_kg")


@dataclass(frozen=True)
class HybridSettings(ChainSettings):
    """Numerical settings, not tuned.

    Attributes
    ----------
    damping_s : η of the material, at least half a step.
    """

    damping_s: float = 0.02


class _HybridRun(ChainRun):
    """One batch of rods with a spring and a damper in every hinge and slide."""

    hinges = HINGES
    _settings: HybridSettings

    def _set_parameters(self, vectors: np.ndarray) -> None:
        modulus, friction, endpoint_kg = vectors.T
        self._place_masses(np.full(len(vectors), self._cable.mass_kg), endpoint_kg, friction)
        area = np.pi * self._cable.radius_m**2
        inertia = 0.25 * np.pi * self._cable.radius_m**4
        bending = modulus[:, None] * inertia / self._geometry.bends_m
        stretching = modulus[:, None] * area / self._geometry.stretches_m
        self._stiffen_hinges(bending)
        self._stiffness[:, SLIDES] = stretching
        self._damping[:, HINGES] = self._settings.damping_s * bending
        self._damping[:, SLIDES] = self._settings.damping_s * stretching

    def state(self) -> ChainState:
        return rod_state(
            self._qpos,
            self._qvel,
            self._earlier,
            self._geometry,
            self._points_kg,
            self._friction_n,
            self._settings.sliding_speed_m_s,
        )

    def _apply(self, state: ChainState) -> None:
        apply_rod_forces(
            state.force_n, state.heading, self._geometry.half_m, self._qpos, self._applied
        )


class HybridSimulator(ChainSimulator):
    """A soft rod with a rigid endpoint in the plane, in `mujoco.batch`.

    Its parameters: Young's modulus of the rod, planar friction μ and the endpoint's mass. The
    rod's length, radius and mass are taken as measured.
    """

    name = "hybrid"
    own = PARAMETERS
    stretches = True
    run = _HybridRun

    def __init__(
        self,
        cable: Cable,
        parameters: Sequence[Parameter],
        settings: HybridSettings,
        effects: Sequence[Effect] = (),
    ) -> None:
        if settings.damping_s < 0.5 * settings.step_s:
            raise ValueError(
                f"hybrid simulator: damping_s must be at least half of step_s, got "
                f"{settings.damping_s} and {settings.step_s}"
            )
        super().__init__(cable, parameters, settings, effects)
