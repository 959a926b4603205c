"""The segmented and the hybrid cable (paper, "Three Simulation Models"), in `mujoco.batch`.

Both are chains in the board's plane, dragged by the logged tool. The planar reduction replaces
contacts by what they amount to on a level board: Coulomb friction μ m g against the motion of
every segment.

Springs stand in joints, not between mass points, because MuJoCo integrates the joints' damping
implicitly: a damping of half a step times the spring is what an implicit rule would add, so that a
chain with η ≥ h/2 is stable at a step h of 4 ms however stiff it is. A rod of mass points, as
MuJoCo's flex makes it, needs steps below 2/ω of its stiffest spring: 0.5 ms at E = 0.2 MPa and
0.2 ms at 1 MPa.
"""

from dataclasses import dataclass

import numpy as np

from robotcast.simulators.mujoco_chain import ChainRun, ChainSettings, ChainSimulator
from robotcast.simulators.mujoco_kernels import damp_hinges


@dataclass(frozen=True)
class SegmentedSettings(ChainSettings):
    """Numerical settings, not tuned."""

    bending_rate_rad_s: float = 0.2  # ω₀ of the Coulomb moment in the joints, M ω/√(ω² + ω₀²)


class _SegmentedRun(ChainRun):
    _settings: SegmentedSettings

    def _set_parameters(self, vectors: np.ndarray) -> None:
        values = dict(zip(SegmentedSimulator.own, vectors.T, strict=True))
        self._place_masses(values["cable_mass_kg"], values["endpoint_mass_kg"], values["friction"])
        stiffness = values["bending_stiffness_n_m2"][:, None] / self._geometry.bends_m
        stiffness[:, 0] *= values["grip_stiffness"]
        self._set_springs(stiffness, values["axial_stiffness_n"])
        damping_s = values["bending_damping_s"][:, None] + self._effects.total("damping_time")
        self._viscous = damping_s * stiffness
        self._joint_friction = values["joint_friction_n_m"]

    def _damp(self) -> None:
        damp_hinges(
            self._qvel,
            self._hinges,
            self._viscous,
            self._joint_friction,
            self._settings.bending_rate_rad_s**2,
            self._damping,
        )


class SegmentedSimulator(ChainSimulator):
    """A chain of rigid capsules with springs and dampers in their hinges.

    Its parameters: planar friction μ, the masses of cable and endpoint, the Coulomb moment in
    every joint, the bending stiffness EI, the retardation time η of bending (Kelvin–Voigt: the
    bending moment is EI (κ + η dκ/dt)), how much stiffer than elsewhere the cable bends where it
    leaves the gripper, and the axial stiffness EA. Below half a step η cannot keep a stiff joint
    stable. Length and radius are taken as measured.

    A few segments also stretch. By length it is little, 0.1 % at the tension of a cast, but it
    decides what happens when a slack cable comes taut: it throws the endpoint back, or eases the
    jerk that an inextensible chain passes on at once. A whip-like cast with E A = 190 N can end
    more than 10 cm from one with an inextensible cable.
    """

    name = "segmented"
    own = (
        "friction",
        "cable_mass_kg",
        "endpoint_mass_kg",
        "joint_friction_n_m",
        "bending_stiffness_n_m2",
        "bending_damping_s",
        "grip_stiffness",
        "axial_stiffness_n",
    )
    tunes = ("bending_damping", "bending_hysteresis")  # the latter is the joint friction
    run = _SegmentedRun


class _HybridRun(ChainRun):
    def _set_parameters(self, vectors: np.ndarray) -> None:
        modulus, friction, endpoint_kg = vectors.T
        self._place_masses(np.full(len(vectors), self._cable.mass_kg), endpoint_kg, friction)
        area = np.pi * self._cable.radius_m**2
        inertia = 0.25 * np.pi * self._cable.radius_m**4
        bending = modulus[:, None] * inertia / self._geometry.bends_m
        self._set_springs(bending, modulus * area)
        damping_s = self._settings.stretch_damping_s + self._effects.total("damping_time")
        self._damping[:, self._hinges] = damping_s * bending


class HybridSimulator(ChainSimulator):
    """A soft round rod with a rigid endpoint.

    One Young's modulus E sets bending and stretching: the bending moment is E I κ and the tension
    E A ε, I = π r⁴/4 and A = π r². Both have the same small material damping: σ = E (ε + η dε/dt)
    (Kelvin–Voigt). Each segment has a hinge with the spring E I / l, and some a slide along
    themselves with the spring E A / l, l the length of cable that bends or stretches there.

    Its parameters: Young's modulus of the rod, planar friction μ and the endpoint's mass. The
    rod's length, radius and mass are taken as measured.
    """

    name = "hybrid"
    own = ("youngs_modulus_pa", "friction", "endpoint_mass_kg")
    run = _HybridRun
