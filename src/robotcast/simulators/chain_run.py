"""One batch of planar chains in `mujoco.batch`: what the simulators on chains share."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np
from mujoco.batch import Batch

from robotcast.effects.active import ActiveEffects
from robotcast.measurements.measurement_set import Cable
from robotcast.simulators.cable_effects import CableEffects
from robotcast.simulators.chain import (
    TOOL_ARMATURE,
    TOOL_DOFS,
    ChainGeometry,
    capsule_inertia,
)
from robotcast.simulators.chain_state import ChainState

GRAVITY_M_S2 = 9.81


@dataclass(frozen=True)
class ChainSettings:
    """Numerical settings, not tuned.

    Attributes
    ----------
    segments : number of segments (the paper's segmented cable: 18).
    step_s : integration step; runs that diverge with it are run again with half of it.
    sliding_speed_m_s : ε of the regularised Coulomb friction v/√(v² + ε²).
    batch_size : simulations stepped side by side.
    threads : 0 for all cores; the result does not depend on it.
    """

    segments: int = 18
    step_s: float = 0.004
    sliding_speed_m_s: float = 0.01
    batch_size: int = 512
    threads: int = 0


class ChainRun(ABC):
    """A batch of chains that starts straight and at rest, then steps behind the tool.

    A kind of chain says which columns of the generalised coordinates are its `hinges`, sets
    its joints and applies its forces; the rest is done here.

    Parameters
    ----------
    cable, geometry : what is dragged, and how it is cut.
    model : the chain, compiled with the step of this run.
    pose, lean_rad, vectors, active : see `planar_batch.Start`.
    """

    hinges: ClassVar[slice]

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
        qpos = np.zeros((len(pose), model.nq))
        qpos[:, :TOOL_DOFS] = pose
        qpos[:, TOOL_DOFS] = lean_rad
        self._time_s = 0.0
        self._earlier: np.ndarray | None = None
        self._begin(vectors, active, qpos, np.zeros_like(qpos))

    def _begin(
        self, vectors: np.ndarray, active: ActiveEffects, qpos: np.ndarray, qvel: np.ndarray
    ) -> None:
        """Make the batch, at these generalised positions and velocities (n_sim, n_dof)."""
        self._vectors = vectors
        self._effects = CableEffects(active, self._cable, self._geometry)
        self._batch = Batch(self._model, len(qpos), nthread=1)
        self._qpos, self._qvel = self._batch.bind("qpos"), self._batch.bind("qvel")
        self._applied = self._batch.bind("qfrc_applied")
        self._damping = self._batch.expand("dof_damping")
        self._stiffness = self._batch.expand("jnt_stiffness")
        self._qpos[:], self._qvel[:] = qpos, qvel
        self._set_parameters(vectors)

    @abstractmethod
    def _set_parameters(self, vectors: np.ndarray) -> None:
        """Write masses and joints of every simulation."""

    @abstractmethod
    def state(self) -> ChainState:
        """Return the mass points of the simulations."""

    @abstractmethod
    def _apply(self, state: ChainState) -> None:
        """Write the damping of the joints, and the moments of the forces on the points."""

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

    def _stiffen_hinges(self, stiffness_n_m: np.ndarray) -> None:
        """Write the hinges' springs, (n_sim, n)."""
        self._stiffness[:, self.hinges] = stiffness_n_m
        self._stiffness_n_m2 = stiffness_n_m * self._geometry.bends_m

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
        moments = self._effects.act(
            state,
            mass_kg=self._points_kg,
            friction_n=self._friction_n,
            bend_rad=self._qpos[:, self.hinges],
            bend_rate_rad_s=self._qvel[:, self.hinges],
            stiffness_n_m2=self._stiffness_n_m2,
            time_s=self._time_s,
            step_s=self._step_s,
        )
        self._apply(state)
        if moments is not None:
            self._applied[:, self.hinges] += moments
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
