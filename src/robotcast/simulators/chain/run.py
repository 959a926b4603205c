"""One batch of planar chains in `mujoco.batch`: what the simulators on chains share."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.batch import Batch

from robotcast.effects.active import ActiveEffects
from robotcast.measurements.measurement_set import Cable
from robotcast.simulators.cable_effects import CableEffects
from robotcast.simulators.chain.model import TOOL_ARMATURE, chain_model
from robotcast.simulators.chain.state import ChainState, apply_forces, chain_state
from robotcast.simulators.chain.undistracted import undistracted
from robotcast.simulators.geometry import GRAVITY_M_S2, TOOL_DOFS, ChainGeometry, capsule_inertia


@dataclass(frozen=True)
class ChainSettings:
    """Numerical settings, not tuned.

    Attributes
    ----------
    segments : number of segments (the paper's segmented cable: 18).
    stretches : how many of them stretch.
    stretch_damping_s : retardation time of stretching, at least half a step. The tension is
        EA (ε + η dε/dt) (Kelvin–Voigt), its damping integrated implicitly: at η ≥ h/2 a chain is
        stable at a step h however stiff it is.
    step_s : integration step; runs that diverge with it are run again with half of it.
    sliding_speed_m_s : ε of the regularised Coulomb friction v/√(v² + ε²).
    batch_size : simulations stepped side by side.
    threads : 0 for all cores; the result does not depend on it.
    """

    segments: int = 18
    stretches: int = 3
    stretch_damping_s: float = 0.003
    step_s: float = 0.004
    sliding_speed_m_s: float = 0.01
    batch_size: int = 512
    threads: int = 0

    def __post_init__(self) -> None:
        """Raise ValueError for a damping with which stretching would diverge."""
        if self.stretch_damping_s < 0.5 * self.step_s:
            raise ValueError(
                f"stretch_damping_s must be at least half of step_s, got "
                f"{self.stretch_damping_s} and {self.step_s}"
            )


def implicitly_damped(geometry: ChainGeometry, step_s: float) -> mujoco.MjModel:
    """Compile the chain for runs, which themselves see to it that damping is implicit."""
    model = chain_model(geometry, step_s)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_EULERDAMP)
    return model


class ChainRun(ABC):
    """A batch of chains that starts straight and at rest, then steps behind the tool.

    A kind of chain sets its joints from its parameters, and may damp them anew at every step;
    the rest is done here.

    MuJoCo's Euler step keeps velocities half a step behind positions. Forces that depend on
    velocity are therefore taken at 1.5 v_n − 0.5 v_{n−1}, and the centripetal forces, which
    MuJoCo takes at v_n, are corrected to it. So a step of 4 ms errs by less than 0.3 % of cable
    length on most casts (tests/simulators/test_segmented.py).

    Damping is integrated implicitly: an Euler step solves (M + h D) a = f. MuJoCo's own way
    factorizes M first and then M + h D; here h D stands in M as the joints' armature, which
    gives the same bits with one factorization.

    Parameters
    ----------
    cable, geometry : what is dragged, and how it is cut.
    model : of `implicitly_damped`, with the step of this run.
    pose, lean_rad, vectors, active : see `batch.planar.Start`.
    """

    def __init__(
        self,
        cable: Cable,
        geometry: ChainGeometry,
        model: mujoco.MjModel,
        settings: ChainSettings,
        pose: np.ndarray,
        lean_rad: np.ndarray,
        vectors: np.ndarray,
        active: ActiveEffects,
    ) -> None:
        self._cable, self._geometry, self._model = cable, geometry, model
        self._settings = settings
        self._step_s = float(model.opt.timestep)
        self._hinges = geometry.hinges
        qpos = np.zeros((len(pose), model.nq))
        qpos[:, :TOOL_DOFS] = pose
        qpos[:, self._hinges[0]] = lean_rad
        qpos[:, geometry.slides[geometry.stretching]] = self._unloaded_m(
            CableEffects(active, cable, geometry)
        )
        self._time_s = 0.0
        self._earlier: np.ndarray | None = None
        self._begin(vectors, active, qpos, np.zeros_like(qpos))

    def _begin(
        self, vectors: np.ndarray, active: ActiveEffects, qpos: np.ndarray, qvel: np.ndarray
    ) -> None:
        """Make the batch, at these generalised positions and velocities (n_sim, n_dof)."""
        undistracted()
        self._vectors = vectors
        self._effects = CableEffects(active, self._cable, self._geometry)
        self._batch = Batch(self._model, len(qpos), nthread=1)
        self._qpos, self._qvel = self._batch.bind("qpos"), self._batch.bind("qvel")
        self._applied = self._batch.bind("qfrc_applied")
        self._damping = self._batch.expand("dof_damping")
        self._armature = self._batch.expand("dof_armature")
        self._stiffness = self._batch.expand("jnt_stiffness")
        slides = self._geometry.slides[self._geometry.stretching]
        self._batch.expand("qpos_spring")[:, slides] = self._unloaded_m(self._effects)
        self._qpos[:], self._qvel[:] = qpos, qvel
        self._set_parameters(vectors)

    def _unloaded_m(self, effects: CableEffects) -> np.ndarray | float:
        """Return how far the stretching segments are drawn out without load, (n_sim, 1) or 0."""
        return effects.extra_m() / max(int(self._geometry.stretching.sum()), 1)

    @abstractmethod
    def _set_parameters(self, vectors: np.ndarray) -> None:
        """Write masses and joints of every simulation."""

    def _damp(self) -> None:  # noqa: B027 - most chains damp their joints once and for all
        """Write the damping of the joints for the next step."""

    def state(self) -> ChainState:
        """Return the mass points of the simulations."""
        return chain_state(
            self._qpos,
            self._qvel,
            self._earlier,
            self._geometry,
            self._points_kg,
            self._friction_n,
            self._settings.sliding_speed_m_s,
        )

    def _place_masses(
        self, cable_kg: np.ndarray, endpoint_kg: np.ndarray, friction: np.ndarray
    ) -> None:
        """Write the masses of every simulation and keep μ m g; arguments hold (n_sim,) each."""
        geometry, cable = self._geometry, self._cable
        n, lengths, tip = len(geometry.lengths_m), geometry.lengths_m, endpoint_kg
        mass = cable_kg[:, None] * (lengths / cable.length_m)
        mass = self._effects.distributed(mass)
        self._points_kg = np.column_stack([mass, tip]).astype(np.float32)
        weight_n = (friction * GRAVITY_M_S2).astype(np.float32)
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

    def _set_springs(self, bending_n_m: np.ndarray, stretching_n: np.ndarray) -> None:
        """Write the springs of the hinges, (n_sim, n), and EA of the cable, (n_sim,)."""
        geometry = self._geometry
        slides = geometry.slides[geometry.stretching]
        stiffness_n_m = stretching_n[:, None] / geometry.stretches_m
        self._stiffness[:, self._hinges] = bending_n_m
        self._stiffness[:, slides] = stiffness_n_m
        self._damping[:, slides] = self._settings.stretch_damping_s * stiffness_n_m
        self._stiffness_n_m2 = bending_n_m * geometry.bends_m

    def keep(self, kept: np.ndarray, active: ActiveEffects) -> None:
        """Go on with the simulations numbered `kept` only, in this order."""
        self._begin(self._vectors[kept], active, self._qpos[kept], self._qvel[kept])
        if self._earlier is not None:
            self._earlier = self._earlier[kept]

    def fastest_rate(self) -> np.ndarray:
        """Return the largest generalised speed of each simulation, (n_sim,)."""
        return np.abs(self._qvel).max(axis=1)

    def step(self, state: ChainState, next_pose: np.ndarray) -> None:
        """Advance one step; the tool reaches `next_pose` (n_sim, 3) at its end."""
        self._drive_tool(next_pose)
        moments = self._moments(state) if self._effects.act_here else None
        self._damp()
        apply_forces(
            state.force_n,
            state.heading,
            self._geometry.half_m,
            self._hinges,
            self._geometry.slides,
            self._qpos,
            self._applied,
        )
        if moments is not None:
            self._applied[:, self._hinges] += moments
        np.multiply(self._damping[:, TOOL_DOFS:], self._step_s, out=self._armature[:, TOOL_DOFS:])
        self._earlier = state.stepped
        self._time_s += self._step_s
        self._batch.step()

    def _moments(self, state: ChainState) -> np.ndarray | None:
        """Let the effects act on the points; return their moments in the hinges, if any."""
        return self._effects.act(
            state,
            mass_kg=self._points_kg,
            friction_n=self._friction_n,
            bend_rad=self._qpos[:, self._hinges],
            bend_rate_rad_s=self._qvel[:, self._hinges],
            stiffness_n_m2=self._stiffness_n_m2,
            time_s=self._time_s,
            step_s=self._step_s,
        )

    def _drive_tool(self, next_pose: np.ndarray) -> None:
        """Push the tool so that it stands at `next_pose` after the step.

        A force on a large armature, not an overwritten velocity: the cable's inertia is kept.
        """
        wanted = (next_pose - self._qpos[:, :TOOL_DOFS]) / self._step_s
        change = wanted - self._qvel[:, :TOOL_DOFS]
        self._applied[:, :TOOL_DOFS] = change * (TOOL_ARMATURE / self._step_s)
