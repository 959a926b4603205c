"""The segmented cable: rigid capsules in the board's plane, dragged by the logged tool.

Paper, "Three Simulation Models", in MuJoCo. The planar reduction replaces contacts by what
they amount to on a level board: Coulomb friction μ m g against the motion of every segment.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import mujoco
import numpy as np
from mujoco.batch import Batch

from robotcast.effects.active import ActiveEffects, parameters_of
from robotcast.effects.effect import Effect
from robotcast.fitting.parameter import Parameter
from robotcast.measurements.measurement_set import Cable
from robotcast.progress import Progress, silent
from robotcast.simulators.cable_effects import CableEffects
from robotcast.simulators.chain import (
    TOOL_ARMATURE,
    TOOL_DOFS,
    ChainGeometry,
    capsule_inertia,
    chain_model,
)
from robotcast.simulators.chain_state import (
    ChainState,
    apply_forces,
    chain_state,
    damp_joints,
)
from robotcast.simulators.planar_batch import simulate_planar
from robotcast.simulators.simulator import Cast, Prediction

GRAVITY_M_S2 = 9.81
FINER = 2  # by how much the step of a run that diverged is cut
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
    step_s : integration step; runs that diverge with it are run again with half of it.
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
    effects : the effects that act; their parameters follow the simulator's own.
    """

    name = "segmented"
    tunes = ("bending_hysteresis",)  # effects that are parameters here: the joint friction

    def __init__(
        self,
        cable: Cable,
        parameters: Sequence[Parameter],
        settings: SegmentedSettings | None = None,
        effects: Sequence[Effect] = (),
    ) -> None:
        names = tuple(p.name for p in parameters)
        if names != PARAMETERS:
            raise ValueError(f"segmented simulator: expected parameters {PARAMETERS}, got {names}")
        twice = [effect.name for effect in effects if effect.name in self.tunes]
        if twice:
            raise ValueError(f"segmented simulator: {', '.join(twice)} is a parameter of its own")
        self.cable = cable
        self.effects = tuple(effects)
        self.parameters = (*parameters, *parameters_of(effects))
        self.settings = settings or SegmentedSettings()
        self._geometry = ChainGeometry.of_cable(cable.length_m, self.settings.segments)
        steps = (self.settings.step_s, self.settings.step_s / FINER)
        self._models = {step_s: chain_model(self._geometry, step_s) for step_s in steps}

    def simulate(
        self,
        casts: Sequence[Cast],
        vectors: np.ndarray,
        *,
        retry: bool = True,
        progress: Progress = silent,
    ) -> Prediction:
        """Simulate every cast under every parameter vector (see `Simulator`)."""
        # diverged runs are marked in the prediction; MuJoCo's lines would only bury the bar
        mujoco.set_mju_user_warning(lambda _: None)
        starts = [(step_s, partial(_SegmentedRun, self, step_s)) for step_s in self._models]
        return simulate_planar(
            starts if retry else starts[:1],
            casts,
            vectors,
            n_parameters=len(PARAMETERS),
            effects=self.effects,
            batch_size=self.settings.batch_size,
            threads=self.settings.threads,
            progress=progress,
        )


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
        step_s: float,
        pose: np.ndarray,
        lean_rad: np.ndarray,
        vectors: np.ndarray,
        active: ActiveEffects,
    ) -> None:
        self._simulator = simulator
        self._settings, self._step_s = simulator.settings, step_s
        self._geometry = simulator._geometry
        qpos = np.zeros((len(pose), TOOL_DOFS + len(self._geometry.lengths_m)))
        qpos[:, :TOOL_DOFS] = pose
        qpos[:, TOOL_DOFS] = lean_rad
        self._time_s = 0.0
        self._earlier: np.ndarray | None = None
        self._begin(vectors, active, qpos, np.zeros_like(qpos))

    def _begin(
        self, vectors: np.ndarray, active: ActiveEffects, qpos: np.ndarray, qvel: np.ndarray
    ) -> None:
        """Make the batch, at these generalised positions and velocities (n_sim, 3 + n)."""
        self._vectors = vectors
        self._effects = CableEffects(active, self._simulator.cable, self._geometry)
        self._batch = Batch(self._simulator._models[self._step_s], len(qpos), nthread=1)
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
        mass = self._effects.distributed(mass)
        self._points_kg = np.column_stack([mass, tip]).astype(np.float32)
        weight_n = (values["friction"] * GRAVITY_M_S2).astype(np.float32)
        self._friction_n = weight_n[:, None] * self._points_kg
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
        self._joint_friction = values["joint_friction_n_m"]
        self._stiffness_n_m2 = stiffness * geometry.bends_m

    def keep(self, kept: np.ndarray, active: ActiveEffects) -> None:
        self._begin(self._vectors[kept], active, self._qpos[kept], self._qvel[kept])
        if self._earlier is not None:
            self._earlier = self._earlier[kept]

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

    def fastest_rate(self) -> np.ndarray:
        return np.abs(self._qvel).max(axis=1)

    def step(self, state: ChainState, next_pose: np.ndarray) -> None:
        self._drive_tool(next_pose)
        damp_joints(
            self._qvel,
            self._viscous,
            self._joint_friction,
            self._settings.bending_rate_rad_s**2,
            self._damping,
        )
        moments = self._effects.act(
            state,
            mass_kg=self._points_kg,
            friction_n=self._friction_n,
            bend_rad=self._qpos[:, TOOL_DOFS:],
            bend_rate_rad_s=self._qvel[:, TOOL_DOFS:],
            stiffness_n_m2=self._stiffness_n_m2,
            time_s=self._time_s,
            step_s=self._step_s,
        )
        apply_forces(state.force_n, state.heading, self._geometry.half_m, self._applied)
        if moments is not None:
            self._applied[:, TOOL_DOFS:] += moments
        self._earlier = state.stepped
        self._time_s += self._step_s
        self._batch.step()

    def _drive_tool(self, next_pose: np.ndarray) -> None:
        """Push the tool so that it stands at `next_pose` after the step.

        A force on a large armature, not an overwritten velocity: the cable's inertia is kept.
        """
        wanted = (next_pose - self._qpos[:, :TOOL_DOFS]) / self._step_s
        change = wanted - self._qvel[:, :TOOL_DOFS]
        self._applied[:, :TOOL_DOFS] = change * (TOOL_ARMATURE / self._step_s)
