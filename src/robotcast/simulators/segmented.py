"""The segmented cable: rigid capsules in the board's plane, dragged by the logged tool.

Paper, "Three Simulation Models", in MuJoCo. The planar reduction replaces contacts by what
they amount to on a level board: Coulomb friction μ m g against the motion of every segment.
"""

from dataclasses import dataclass

import numpy as np

from robotcast.simulators.chain import TOOL_DOFS
from robotcast.simulators.chain_run import ChainRun, ChainSettings
from robotcast.simulators.chain_simulator import ChainSimulator
from robotcast.simulators.chain_state import ChainState, apply_forces, chain_state, damp_joints

PARAMETERS = (
    "friction",
    "cable_mass_kg",
    "endpoint_mass_kg",
    "joint_friction_n_m",
    "bending_stiffness_n_m2",
    "bending_damping_s",
    "grip_stiffness",
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
    """One batch of chains with springs and dampers in their hinges.

    MuJoCo's Euler step keeps velocities half a step behind positions. Forces that depend on
    velocity are therefore taken at 1.5 v_n − 0.5 v_{n−1}, and the centripetal forces, which
    MuJoCo takes at v_n, are corrected to it. At 4 ms that brings the step's error on a cast
    from 1.3 % to 0.1 % of cable length (tests/simulators/test_segmented.py).
    """

    hinges = slice(TOOL_DOFS, None)

    _settings: SegmentedSettings

    def _set_parameters(self, vectors: np.ndarray) -> None:
        values = dict(zip(PARAMETERS, vectors.T, strict=True))
        self._place_masses(values["cable_mass_kg"], values["endpoint_mass_kg"], values["friction"])
        stiffness = values["bending_stiffness_n_m2"][:, None] / self._geometry.bends_m
        stiffness[:, 0] *= values["grip_stiffness"]
        self._stiffen_hinges(stiffness)
        self._viscous = values["bending_damping_s"][:, None] * stiffness
        self._joint_friction = values["joint_friction_n_m"]

    def state(self) -> ChainState:
        return chain_state(
            self._qpos,
            self._qvel,
            self._earlier,
            self._geometry,
            self._points_kg,
            self._friction_n,
            self._settings.sliding_speed_m_s,
        )

    def _apply(self, state: ChainState) -> None:
        damp_joints(
            self._qvel,
            self._viscous,
            self._joint_friction,
            self._settings.bending_rate_rad_s**2,
            self._damping,
        )
        apply_forces(state.force_n, state.heading, self._geometry.half_m, self._applied)


class SegmentedSimulator(ChainSimulator):
    """A chain of capsules in the plane, in `mujoco.batch`.

    Its parameters: planar friction μ, the masses of cable and endpoint, the Coulomb moment in
    every joint, the bending stiffness EI, the retardation time η of bending (Kelvin–Voigt: the
    bending moment is EI (κ + η dκ/dt)), and how much stiffer than elsewhere the cable bends
    where it leaves the gripper. Below half a step η cannot keep a stiff joint stable.

    Length and radius are taken as measured.
    """

    name = "segmented"
    own = PARAMETERS
    tunes = ("bending_hysteresis",)  # the joint friction
    run = _SegmentedRun
