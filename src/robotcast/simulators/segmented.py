"""The segmented cable: rigid capsules in the board's plane, dragged by the logged tool.

Paper, "Three Simulation Models", in MuJoCo. The planar reduction replaces contacts by what
they amount to on a level board: Coulomb friction μ m g against the motion of every segment.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.batch import Batch

from robotcast.measurements.measurement_set import Cable
from robotcast.progress import Progress, silent
from robotcast.simulators.chain import (
    TOOL_ARMATURE,
    TOOL_DOFS,
    ChainGeometry,
    ChainState,
    capsule_inertia,
    chain_model,
    chain_state,
    hinge_moments,
)
from robotcast.fitting.parameter import Parameter
from robotcast.simulators.planar_batch import PlanarRun, simulate_planar
from robotcast.simulators.simulator import Cast, Prediction

GRAVITY_M_S2 = 9.81
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
class SegmentedSettings:
    """Numerical settings, not tuned.

    Attributes
    ----------
    segments : number of capsules (the paper: 18).
    step_s : integration step.
    sliding_speed_m_s : ε of the regularised Coulomb friction v/√(v² + ε²).
    bending_rate_rad_s : the same for the Coulomb moment in the joints.
    batch_size : simulations stepped side by side.
    threads : 0 for all cores; the result does not depend on it.
    """

    segments: int = 18
    step_s: float = 0.004
    sliding_speed_m_s: float = 0.01
    bending_rate_rad_s: float = 0.2
    batch_size: int = 512
    threads: int = 0


class SegmentedSimulator:
    """A chain of capsules in the plane, in `mujoco.batch`.

    Parameters
    ----------
    cable : its length and radius are taken as measured; its masses are parameters.
    parameters : the parameters named in `PARAMETERS`, in that order: planar friction μ,
        the masses of cable and endpoint, the Coulomb moment in every joint, the bending
        stiffness EI, and the retardation time η of bending (Kelvin–Voigt: the bending moment
        is EI (κ + η dκ/dt)), and how much stiffer than elsewhere the cable bends where it
        leaves the gripper. Below half a step η cannot keep a stiff joint stable.
    """

    name = "segmented"

    def __init__(
        self,
        cable: Cable,
        parameters: Sequence[Parameter],
        settings: SegmentedSettings | None = None,
    ) -> None:
        names = tuple(p.name for p in parameters)
        if names != PARAMETERS:
            raise ValueError(f"segmented simulator: expected parameters {PARAMETERS}, got {names}")
        self.cable = cable
        self.parameters = tuple(parameters)
        self.settings = settings or SegmentedSettings()
        self._geometry = ChainGeometry.of_cable(cable.length_m, self.settings.segments)
        self._model = chain_model(self._geometry, self.settings.step_s)

    def simulate(
        self,
        casts: Sequence[Cast],
        vectors: np.ndarray,
        *,
        progress: Progress = silent,
    ) -> Prediction:
        """Simulate every cast under every parameter vector (see `Simulator`)."""
        # diverged runs are marked in the prediction; MuJoCo's lines would only bury the bar
        mujoco.set_mju_user_warning(lambda _: None)
        return simulate_planar(
            self._start,
            casts,
            vectors,
            n_parameters=len(self.parameters),
            step_s=self.settings.step_s,
            batch_size=self.settings.batch_size,
            threads=self.settings.threads,
            progress=progress,
        )

    def _start(self, pose: np.ndarray, lean_rad: np.ndarray, vectors: np.ndarray) -> PlanarRun:
        return _SegmentedRun(self, pose, lean_rad, vectors)


class _SegmentedRun:
    """One batch of chains: starts straight and at rest, then steps behind the tool.

    MuJoCo's Euler step keeps velocities half a step behind positions. Forces that depend on
    velocity are therefore taken at 1.5 v_n − 0.5 v_{n−1}, and the centripetal forces, which
    MuJoCo takes at v_n, are corrected to it. At 4 ms that brings the step's error on a cast
    from 1.3 % to 0.1 % of cable length (tests/simulators/test_segmented.py).
    """

    def __init__(
        self,
        simulator: SegmentedSimulator,
        pose: np.ndarray,
        lean_rad: np.ndarray,
        vectors: np.ndarray,
    ) -> None:
        self._simulator = simulator
        self._settings = simulator.settings
        self._geometry = simulator._geometry
        qpos = np.zeros((len(pose), TOOL_DOFS + len(self._geometry.lengths_m)))
        qpos[:, :TOOL_DOFS] = pose
        qpos[:, TOOL_DOFS] = lean_rad
        self._begin(vectors, qpos, np.zeros_like(qpos))
        self._earlier: np.ndarray | None = None

    def _begin(self, vectors: np.ndarray, qpos: np.ndarray, qvel: np.ndarray) -> None:
        """Make the batch, at these generalised positions and velocities (n_sim, 3 + n)."""
        self._vectors = vectors
        self._batch = Batch(self._simulator._model, len(qpos), nthread=1)
        self._qpos, self._qvel = self._batch.bind("qpos"), self._batch.bind("qvel")
        self._applied = self._batch.bind("qfrc_applied")
        self._damping = self._batch.expand("dof_damping")
        self._qpos[:], self._qvel[:] = qpos, qvel
        self._set_parameters(dict(zip(PARAMETERS, vectors.T, strict=True)))

    def _set_parameters(self, values: dict[str, np.ndarray]) -> None:
        """Write masses and joints of every simulation; `values` hold (n_sim,) each."""
        geometry, cable = self._geometry, self._simulator.cable
        n, lengths, tip = len(geometry.lengths_m), geometry.lengths_m, values["endpoint_mass_kg"]
        mass = values["cable_mass_kg"][:, None] * (lengths / cable.length_m)
        self._points_kg = np.vstack([mass.T, tip]).astype(np.float32)
        self._friction_n = (values["friction"] * GRAVITY_M_S2).astype(np.float32) * self._points_kg
        centre = np.tile(0.5 * lengths, (len(mass), 1))
        inertia = capsule_inertia(mass, lengths, cable.radius_m)
        # the endpoint's mass sits at the tip of the last segment
        last_kg = mass[:, -1].copy()
        mass[:, -1] += tip
        centre[:, -1] = (0.5 * last_kg + tip) * lengths[-1] / mass[:, -1]
        inertia[:, -1] += last_kg * tip / mass[:, -1] * (0.5 * lengths[-1]) ** 2
        self._batch.expand("body_mass")[:, -n:] = mass
        self._batch.expand("body_ipos")[:, -n:, 0] = centre
        self._batch.expand("body_inertia")[:, -n:] = inertia[:, :, None]
        stiffness = values["bending_stiffness_n_m2"][:, None] / geometry.bends_m
        stiffness[:, 0] *= values["grip_stiffness"]
        self._batch.expand("jnt_stiffness")[:, -n:] = stiffness
        self._viscous = values["bending_damping_s"][:, None] * stiffness
        self._joint_friction = values["joint_friction_n_m"][:, None]

    def keep(self, kept: np.ndarray) -> None:
        self._begin(self._vectors[kept], self._qpos[kept], self._qvel[kept])
        if self._earlier is not None:
            self._earlier = np.ascontiguousarray(self._earlier[:, kept])

    def state(self) -> ChainState:
        return chain_state(self._qpos, self._qvel, self._earlier, self._geometry)

    def fastest_rate(self) -> np.ndarray:
        return np.abs(self._qvel).max(axis=1)

    def step(self, state: ChainState, next_pose: np.ndarray) -> None:
        self._drive_tool(next_pose)
        self._rub_joints()
        force = self._board_friction(state)
        force -= state.centripetal_lag_m_s2 * self._points_kg[:, None]
        moments = hinge_moments(force, state.heading, self._geometry)
        self._applied[:, TOOL_DOFS:] = moments.T
        self._earlier = state.stepped
        self._batch.step()

    def _drive_tool(self, next_pose: np.ndarray) -> None:
        """Push the tool so that it stands at `next_pose` after the step.

        A force on a large armature, not an overwritten velocity: the cable's inertia is kept.
        """
        step_s = self._settings.step_s
        wanted = (next_pose - self._qpos[:, :TOOL_DOFS]) / step_s
        change = wanted - self._qvel[:, :TOOL_DOFS]
        self._applied[:, :TOOL_DOFS] = change * (TOOL_ARMATURE / step_s)

    def _rub_joints(self) -> None:
        """Set the joints' damping so that it carries the Coulomb moment M ω/√(ω² + ω₀²) too.

        MuJoCo integrates damping implicitly, which keeps a dry joint stable at any step.
        """
        rate = self._qvel[:, TOOL_DOFS:]
        regularised = rate * rate
        regularised += self._settings.bending_rate_rad_s**2
        np.sqrt(regularised, out=regularised)
        np.divide(self._joint_friction, regularised, out=regularised)
        np.add(self._viscous, regularised, out=self._damping[:, TOOL_DOFS:])

    def _board_friction(self, state: ChainState) -> np.ndarray:
        """Return −μ m g v/√(v² + ε²) on every mass point, (n + 1, 2, n_sim)."""
        velocity = state.velocity_m_s
        square = velocity[:, 0] * velocity[:, 0]
        square += velocity[:, 1] * velocity[:, 1]
        square += np.float32(self._settings.sliding_speed_m_s**2)
        np.sqrt(square, out=square)
        np.divide(self._friction_n, square, out=square)
        return velocity * -square[:, None]
