"""A planar chain in `mujoco.batch`: what the simulators on MuJoCo share."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import mujoco
import numpy as np
from mujoco.batch import Batch
from numba import cfunc

from robotcast.effects.effect import ActiveEffects, Effect
from robotcast.fitting.parameter import Parameter
from robotcast.measurements.measurement_set import Cable
from robotcast.simulators.batch import FINER, BatchSimulator, Settings, Start
from robotcast.simulators.chain import (
    GRAVITY_M_S2,
    TOOL_DOFS,
    CableState,
    ChainEffects,
    ChainGeometry,
    capsule_inertia,
)
from robotcast.simulators.mujoco_kernels import apply_forces, chain_state

TOOL_ARMATURE = 1e4  # kg and kg m²: so large that the cable cannot move the held end


@dataclass(frozen=True)
class ChainSettings(Settings):
    """Numerical settings, not tuned.

    The tension of the cable is EA (ε + η dε/dt) (Kelvin–Voigt), η `stretch_damping_s`, its damping
    integrated implicitly: at η ≥ h/2 a chain is stable at a step h however stiff it is.
    """

    stretches: int = 3  # of the segments
    stretch_damping_s: float = 0.003

    def __post_init__(self) -> None:
        """Raise ValueError for a damping with which stretching would diverge."""
        if self.stretch_damping_s < 0.5 * self.step_s:
            raise ValueError(
                f"stretch_damping_s must be at least half of step_s, got "
                f"{self.stretch_damping_s} and {self.step_s}"
            )


class ChainSimulator(BatchSimulator[ChainSettings]):
    """Simulates casts in batches of chains; `run` is what steps one."""

    run: ClassVar[type["ChainRun"]]

    def __init__(
        self,
        cable: Cable,
        parameters: Sequence[Parameter],
        settings: ChainSettings,
        effects: Sequence[Effect] = (),
    ) -> None:
        super().__init__(cable, parameters, settings, effects)
        geometry = ChainGeometry.of_cable(cable.length_m, settings.segments, settings.stretches)
        self._starts = {
            step_s: partial(
                self.run, cable, geometry, implicitly_damped(geometry, step_s), settings
            )
            for step_s in (settings.step_s, settings.step_s / FINER)
        }

    def start(self, step_s: float) -> Start:
        return self._starts[step_s]


def chain_model(geometry: ChainGeometry, step_s: float) -> mujoco.MjModel:
    """Compile the chain: slides x and y and a hinge for the tool, then one hinge a segment.

    Where a segment stretches, a slide along it follows its hinge.

    No contacts, gravity or constraints: friction and every effect enter as applied forces,
    masses and joint properties are written per simulation.
    """
    spec = mujoco.MjSpec()
    spec.option.timestep = step_s
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    for flag in ("CONSTRAINT", "CONTACT", "GRAVITY", "SENSOR", "AUTORESET"):
        spec.option.disableflags |= int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag}"))
    body = spec.worldbody.add_body(name="tool", mass=1e-3, inertia=[1e-6] * 3)
    body.explicitinertial = True
    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    for name, kind, axis in (
        ("x", slide, [1, 0, 0]),
        ("y", slide, [0, 1, 0]),
        ("yaw", hinge, [0, 0, 1]),
    ):
        body.add_joint(name=name, type=kind, axis=axis, armature=TOOL_ARMATURE)
    for k, hinge_m in enumerate((geometry.stub_m, *geometry.lengths_m[:-1])):
        body = body.add_body(name=f"segment{k}", pos=[hinge_m, 0, 0], mass=1e-3, inertia=[1e-7] * 3)
        body.explicitinertial = True
        body.add_joint(name=f"hinge{k}", type=hinge, axis=[0, 0, 1])
        if geometry.stretching[k]:
            body.add_joint(name=f"slide{k}", type=slide, axis=[1, 0, 0])
    return spec.compile()


def implicitly_damped(geometry: ChainGeometry, step_s: float) -> mujoco.MjModel:
    """Compile the chain for runs, which themselves see to it that damping is implicit."""
    model = chain_model(geometry, step_s)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_EULERDAMP)
    return model


@cfunc("float64()", cache=True)
def _zero() -> float:
    return 0.0


def quiet_mujoco() -> None:
    """Have MuJoCo, in this process, neither print what diverged nor read the clock.

    Runs that diverge are marked in the prediction; a line each would only bury the bar. Its
    profiler, on by default in Python, reads the clock about thirty times a step, a tenth of what
    a planar chain takes; `MjData.timer` stays at zero. A timer that somebody has set is kept.
    """
    mujoco.set_mju_user_warning(lambda _: None)
    if mujoco.get_mjcb_time() is None:
        mujoco.set_mjcb_time(_zero.ctypes)


class ChainRun(ABC):
    """A batch of chains (`batch.Run`) that starts straight and at rest, then steps behind the tool.

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
    pose, lean_rad, vectors, active : see `batch.Start`.
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
        self._settings, self._step_s = settings, float(model.opt.timestep)
        self._hinges, self._slides = geometry.hinges, geometry.slides[geometry.stretching]
        self._time_s = 0.0
        self._earlier = self._stepped = None
        unloaded_m = self._unloaded_m(ChainEffects(active, cable, geometry))
        qpos = np.zeros((len(pose), model.nq))
        qpos[:, :TOOL_DOFS], qpos[:, self._hinges[0]] = pose, lean_rad
        qpos[:, self._slides] = unloaded_m
        self._begin(vectors, active, qpos, np.zeros_like(qpos))

    def _begin(
        self, vectors: np.ndarray, active: ActiveEffects, qpos: np.ndarray, qvel: np.ndarray
    ) -> None:
        """Make the batch, at these generalised positions and velocities (n_sim, n_dof)."""
        quiet_mujoco()
        self._vectors = vectors
        self._effects = ChainEffects(active, self._cable, self._geometry)
        self._batch = Batch(self._model, len(qpos), nthread=1)
        self._qpos, self._qvel = self._batch.bind("qpos"), self._batch.bind("qvel")
        self._applied = self._batch.bind("qfrc_applied")
        self._damping = self._batch.expand("dof_damping")
        self._armature = self._batch.expand("dof_armature")
        self._stiffness = self._batch.expand("jnt_stiffness")
        self._batch.expand("qpos_spring")[:, self._slides] = self._unloaded_m(self._effects)
        self._qpos[:], self._qvel[:] = qpos, qvel
        self._set_parameters(vectors)

    def _unloaded_m(self, effects: ChainEffects) -> np.ndarray | float:
        """Return how far the stretching segments are drawn out without load, (n_sim, 1) or 0."""
        return effects.total("extra_length") / max(len(self._slides), 1)

    @abstractmethod
    def _set_parameters(self, vectors: np.ndarray) -> None:
        """Write masses and joints of every simulation."""

    def _damp(self) -> None:  # noqa: B027 - most chains damp their joints once and for all
        """Write the damping of the joints for the next step."""

    def state(self) -> CableState:
        state, self._stepped = chain_state(
            self._qpos,
            self._qvel,
            self._earlier,
            self._geometry,
            self._points_kg,
            self._friction_n,
            self._settings.sliding_speed_m_s,
        )
        return state

    def fastest_rate(self) -> np.ndarray:
        return np.abs(self._qvel).max(axis=1)

    def keep(self, kept: np.ndarray, active: ActiveEffects) -> None:
        self._begin(self._vectors[kept], active, self._qpos[kept], self._qvel[kept])
        if self._earlier is not None:
            self._earlier = self._earlier[kept]

    def step(self, state: CableState, next_pose: np.ndarray) -> None:
        self._drive_tool(next_pose)
        moments = None
        if self._effects.acting:
            moments = self._effects.act(
                state,
                self._time_s,
                self._step_s,
                self._stiffness_n_m2,
                mass_kg=self._points_kg,
                friction_n=self._friction_n,
                bend_rad=self._qpos[:, self._hinges],
                bend_rate_rad_s=self._qvel[:, self._hinges],
            )
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
        self._earlier = self._stepped
        self._time_s += self._step_s
        self._batch.step()

    def _drive_tool(self, next_pose: np.ndarray) -> None:
        """Push the tool so that it stands at `next_pose` after the step.

        A force on a large armature, not an overwritten velocity: the cable's inertia is kept.
        """
        wanted = (next_pose - self._qpos[:, :TOOL_DOFS]) / self._step_s
        change = wanted - self._qvel[:, :TOOL_DOFS]
        self._applied[:, :TOOL_DOFS] = change * (TOOL_ARMATURE / self._step_s)

    def _place_masses(
        self, cable_kg: np.ndarray, endpoint_kg: np.ndarray, friction: np.ndarray
    ) -> None:
        """Write the masses of every simulation and keep μ m g; arguments hold (n_sim,) each."""
        cable, lengths = self._cable, self._geometry.lengths_m
        n, tip = len(lengths), endpoint_kg
        mass = self._effects.distributed(cable_kg[:, None] * (lengths / cable.length_m))
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
        stiffness_n_m = stretching_n[:, None] / self._geometry.stretches_m
        self._stiffness[:, self._hinges] = bending_n_m
        self._stiffness[:, self._slides] = stiffness_n_m
        self._damping[:, self._slides] = self._settings.stretch_damping_s * stiffness_n_m
        self._stiffness_n_m2 = bending_n_m * self._geometry.bends_m
