"""The segmented cable: rigid capsules in the board's plane, dragged by the logged tool.

Paper, "Three Simulation Models", in MuJoCo. The planar reduction replaces contacts by what
they amount to on a level board: Coulomb friction μ m g against the motion of every segment.

A few segments also stretch. By length it is little, 0.1 % at the tension of a cast, but it
decides what happens when a slack cable comes taut: it throws the endpoint back, or eases the
jerk that an inextensible chain passes on at once. A whip-like cast with E A = 190 N can end
more than 10 cm from one with an inextensible cable.
"""

from dataclasses import dataclass

import numpy as np

from robotcast.simulators.chain.run import ChainRun, ChainSettings
from robotcast.simulators.chain.simulator import ChainSimulator
from robotcast.simulators.chain.state import damp_hinges

PARAMETERS = (
    "friction",
    "cable_mass_kg",
    "endpoint_mass_kg",
    "joint_friction_n_m",
    "bending_stiffness_n_m2",
    "bending_damping_s",
    "grip_stiffness",
    "axial_stiffness_n",
)


@dataclass(frozen=True)
class SegmentedSettings(ChainSettings):
    """Numerical settings, not tuned.

    Attributes
    ----------
    bending_rate_rad_s : ω₀ of the regularised Coulomb moment in the joints, M ω/√(ω² + ω₀²).
    """

    bending_rate_rad_s: float = 0.2


class _SegmentedRun(ChainRun):
    """One batch of chains with springs and dampers in their hinges."""

    _settings: SegmentedSettings

    def _set_parameters(self, vectors: np.ndarray) -> None:
        values = dict(zip(PARAMETERS, vectors.T, strict=True))
        self._place_masses(values["cable_mass_kg"], values["endpoint_mass_kg"], values["friction"])
        stiffness = values["bending_stiffness_n_m2"][:, None] / self._geometry.bends_m
        stiffness[:, 0] *= values["grip_stiffness"]
        self._set_springs(stiffness, values["axial_stiffness_n"])
        damping_s = values["bending_damping_s"][:, None] + self._effects.damping_s()
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
    """A chain of capsules in the plane, in `mujoco.batch`.

    Its parameters: planar friction μ, the masses of cable and endpoint, the Coulomb moment in
    every joint, the bending stiffness EI, the retardation time η of bending (Kelvin–Voigt: the
    bending moment is EI (κ + η dκ/dt)), how much stiffer than elsewhere the cable bends where it
    leaves the gripper, and the axial stiffness EA. Below half a step η cannot keep a stiff joint
    stable.

    Length and radius are taken as measured.
    """

    name = "segmented"
    own = PARAMETERS
    tunes = ("bending_damping", "bending_hysteresis")  # the latter is the joint friction
    run = _SegmentedRun
