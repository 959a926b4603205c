"""The segmented and the hybrid cable (paper, "Three Simulation Models"), in `mujoco.batch`.

Both are chains in the board's plane, dragged by the logged tool. Contacts are what they amount to
on a level board: Coulomb friction μ m g against the motion of every segment. Springs stand in
joints, not between mass points, because MuJoCo integrates the joints' damping implicitly: a chain
with η ≥ h/2 is stable at a step h of 4 ms however stiff it is. A rod of mass points, as MuJoCo's
flex makes it, needs steps below 2/ω of its stiffest spring: 0.2 ms at 1 MPa.

First come kernels that Numba compiles: where a batch of chains is, and what forces on it do. As
NumPy passes this took a fifth of the time. Positions are in single precision, rounded by 0.1 µm.
Shapes: `qpos`, `qvel`, `earlier`, `stepped` and `applied` (n_sim, n_dof); points (…, n_sim, n + 1).
`cut` holds the stub, half the segments' lengths, hinges, slides.
"""

from abc import abstractmethod
from dataclasses import dataclass
from functools import cache

import mujoco
import numpy as np
from mujoco.batch import Batch
from numba import cfunc, njit

from robotcast.effects.effect import ActiveEffects
from robotcast.simulators.chain import (
    GRAVITY_M_S2,
    TOOL_DOFS,
    CableState,
    ChainGeometry,
    Run,
    capsule_inertia,
)
from robotcast.simulators.simulator import Settings, Simulator


@njit(nogil=True, cache=True)
def place(qpos, qvel, earlier, first, axes, cut, stepped, points, lag):
    """Fill `stepped`, `points` (x, y, vx, vy) and the `lag` of every point.

    `stepped` are the velocities that MuJoCo steps from, half a step behind the positions, with how
    fast the tool and every segment turn in place of how fast their hinges do; velocities of
    points are extrapolated by half a step from them and the `earlier`, but at the first step.
    Centre k = where segment k − 1 ends + (u_k + half_k) along segment k, u the stretch; the
    endpoint is where the last segment ends. `lag` is the centripetal and Coriolis acceleration
    −s ω² e + 2 u' ω n, e along the segment and n across it, at the extrapolated rates less that
    at the stepped.
    """
    (cosine, sine), (stub, half, hinges, slides) = axes, cut
    n = half.size
    late, early = np.float32(1.5), np.float32(0.5)
    for i in range(qpos.shape[0]):
        turning = qvel[i, 2]
        stepped[i, 0], stepped[i, 1], stepped[i, 2] = qvel[i, 0], qvel[i, 1], turning
        vx, vy, rate = stepped[i, 0], stepped[i, 1], stepped[i, 2]
        if not first:
            vx = late * vx - early * earlier[i, 0]
            vy = late * vy - early * earlier[i, 1]
            rate = late * rate - early * earlier[i, 2]
        x = np.float32(qpos[i, 0]) + stub * cosine[i, 0]
        y = np.float32(qpos[i, 1]) + stub * sine[i, 0]
        vx -= stub * sine[i, 0] * rate
        vy += stub * cosine[i, 0] * rate
        ax, ay = np.float32(0.0), np.float32(0.0)
        for k in range(n):
            tx, ty, hinge, slide = cosine[i, k + 1], sine[i, k + 1], hinges[k], slides[k]
            turning += qvel[i, hinge]
            stepped[i, hinge] = turning
            slow = stepped[i, hinge]
            rate = slow if first else late * slow - early * earlier[i, hinge]
            behind = slow * slow - rate * rate
            hx, hy = half[k] * tx, half[k] * ty
            if slide >= 0:
                stepped[i, slide] = qvel[i, slide]
                drawn, stretch = stepped[i, slide], np.float32(qpos[i, slide])
                growth = drawn if first else late * drawn - early * earlier[i, slide]
                across = np.float32(2.0) * (rate * growth - slow * drawn)
                ux, uy = stretch * tx, stretch * ty
                x, y = x + ux, y + uy
                vx, vy = vx - uy * rate + growth * tx, vy + ux * rate + growth * ty
                ax, ay = ax + ux * behind - ty * across, ay + uy * behind + tx * across
            x, y, vx, vy = x + hx, y + hy, vx - hy * rate, vy + hx * rate
            ax, ay = ax + hx * behind, ay + hy * behind
            points[0, i, k], points[1, i, k], points[2, i, k], points[3, i, k] = x, y, vx, vy
            lag[0, i, k], lag[1, i, k] = ax, ay
            x, y, vx, vy = x + hx, y + hy, vx - hy * rate, vy + hx * rate
            ax, ay = ax + hx * behind, ay + hy * behind
        points[0, i, n], points[1, i, n], points[2, i, n], points[3, i, n] = x, y, vx, vy
        lag[0, i, n], lag[1, i, n] = ax, ay


@njit(nogil=True, cache=True)
def apply_forces(force, heading, half, hinges, slides, qpos, applied):
    """Write moments [N m] about the hinges and pulls [N] on the slides of forces on the points."""
    # what acts past the centre of each segment has the lever l about its hinge, the centre l/2;
    # both levers grow with the segment's stretch
    for i in range(force.shape[1]):
        fx, fy = force[0, i, half.size], force[1, i, half.size]
        moment = np.float32(0.0)
        for k in range(half.size - 1, -1, -1):
            tx, ty, slide = heading[0, i, k], heading[1, i, k], slides[k]
            lx = fx + np.float32(0.5) * force[0, i, k]
            ly = fy + np.float32(0.5) * force[1, i, k]
            moment += np.float32(2.0) * half[k] * (tx * ly - ty * lx)
            fx, fy = fx + force[0, i, k], fy + force[1, i, k]
            if slide >= 0:
                moment += np.float32(qpos[i, slide]) * (tx * fy - ty * fx)
                applied[i, slide] = tx * fx + ty * fy
            applied[i, hinges[k]] = moment


TOOL_ARMATURE = 1e4  # kg and kg m²: so large that the cable cannot move the held end


@dataclass(frozen=True)
class ChainSettings(Settings):
    """Numerical settings, not tuned."""

    stretches: int = 3
    stretch_damping_s: float = 0.003  # η ≥ h/2 of the tension EA (ε + η dε/dt) (Kelvin–Voigt)
    bending_rate_rad_s: float = 0.2  # ω₀ of a segmented cable's Coulomb moment, M ω/√(ω² + ω₀²)

    def __post_init__(self) -> None:
        if self.stretch_damping_s < 0.5 * self.step_s:
            raise ValueError(
                f"stretch_damping_s must be at least half of step_s, got "
                f"{self.stretch_damping_s} and {self.step_s}"
            )
        if not 0 <= self.stretches <= self.segments:
            raise ValueError(
                f"of {self.segments} segments, 0 to {self.segments} stretch, got {self.stretches}"
            )


def chain_model(geometry: ChainGeometry, step_s: float) -> mujoco.MjModel:
    """Compile the chain, whose joints are the coordinates of `ChainGeometry`.

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
    tool = {"x": (slide, [1, 0, 0]), "y": (slide, [0, 1, 0]), "yaw": (hinge, [0, 0, 1])}
    for name, (kind, axis) in tool.items():
        body.add_joint(name=name, type=kind, axis=axis, armature=TOOL_ARMATURE)
    for k, hinge_m in enumerate((geometry.stub_m, *geometry.lengths_m[:-1])):
        body = body.add_body(name=f"segment{k}", pos=[hinge_m, 0, 0], mass=1e-3, inertia=[1e-7] * 3)
        body.explicitinertial = True
        body.add_joint(name=f"hinge{k}", type=hinge, axis=[0, 0, 1])
        if geometry.stretching[k]:
            body.add_joint(name=f"slide{k}", type=slide, axis=[1, 0, 0])
    return spec.compile()


@cache
def _prepared(length_m: float, segments: int, stretches: int, step_s: float) -> mujoco.MjModel:
    """Compile a chain for runs, which themselves see to it that damping is implicit."""
    model = chain_model(ChainGeometry.of_cable(length_m, segments, stretches), step_s)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_EULERDAMP)
    return model


@cfunc("float64()", cache=True)
def _zero() -> float:
    return 0.0


def quiet_mujoco() -> None:
    """Have MuJoCo, in this process, neither print what diverged nor read the clock.

    A line for each run that diverges would only bury the bar. The profiler, on by default in
    Python, reads the clock about thirty times a step, a tenth of what a planar chain takes. A
    timer that somebody has set is kept.
    """
    mujoco.set_mju_user_warning(lambda _: None)
    if mujoco.get_mjcb_time() is None:
        mujoco.set_mjcb_time(_zero.ctypes)


class ChainRun(Run):
    """A batch of chains. A kind sets its joints from its parameters, and may damp them each step.

    MuJoCo's Euler step keeps velocities half a step behind positions. Forces that depend on
    velocity are therefore taken at 1.5 v_n − 0.5 v_{n−1}, and the centripetal forces, which
    MuJoCo takes at v_n, are corrected to it. So a step of 4 ms errs by less than 0.3 % of cable
    length on most casts (tests/simulators/test_segmented.py).

    Damping is integrated implicitly: an Euler step solves (M + h D) a = f. MuJoCo's own way
    factorizes M first and then M + h D; here h D stands in M as the joints' armature, which
    gives the same bits with one factorization.
    """

    def _lay(self, pose: np.ndarray, lean_rad: np.ndarray) -> None:
        geometry, settings = self._geometry, self._settings
        cut = settings.segments, settings.stretches
        self._model = _prepared(self._cable.length_m, *cut, self._step_s)
        self._hinges, self._slides = geometry.hinges, geometry.slides[geometry.stretching]
        self._turning = np.append(TOOL_DOFS - 1, self._hinges)  # the tool's yaw, then the hinges
        half_m = (0.5 * geometry.lengths_m).astype(np.float32)
        self._cut = half_m, geometry.hinges, geometry.slides
        self._earlier = self._stepped = None
        qpos = np.zeros((len(pose), self._model.nq))
        qpos[:, :TOOL_DOFS], qpos[:, self._hinges[0]] = pose, lean_rad
        qpos[:, self._slides] = self._unloaded_m()
        self._begin(qpos, np.zeros_like(qpos))

    def _begin(self, qpos: np.ndarray, qvel: np.ndarray) -> None:
        """Make the batch, at these generalised positions and velocities (n_sim, n_dof)."""
        quiet_mujoco()
        self._batch = Batch(self._model, len(qpos), nthread=1)
        self._qpos, self._qvel = self._batch.bind("qpos"), self._batch.bind("qvel")
        self._applied = self._batch.bind("qfrc_applied")
        self._damping = self._batch.expand("dof_damping")
        self._armature = self._batch.expand("dof_armature")
        self._stiffness = self._batch.expand("jnt_stiffness")
        self._batch.expand("qpos_spring")[:, self._slides] = self._unloaded_m()
        self._qpos[:], self._qvel[:] = qpos, qvel
        self._set_parameters(self._vectors)

    @abstractmethod
    def _set_parameters(self, vectors: np.ndarray) -> None:
        """Write masses and joints of every simulation."""

    def _damp(self) -> None:
        """Write the damping of the joints for the next step."""

    def _total(self, hook: str) -> np.ndarray | float:
        """Return the sum of what `damping_time` [s] or `extra_length` [m] add, (n_sim, 1) or 0."""
        return sum((add(**values) for add, values, _ in self._active.each(hook)), start=0.0)

    def _unloaded_m(self) -> np.ndarray | float:
        """Return how far the stretching segments are drawn out without load, (n_sim, 1) or 0."""
        return self._total("extra_length") / max(len(self._slides), 1)

    def state(self) -> CableState:
        """Return the mass points, and as forces the board's friction and the correction."""
        angle = np.cumsum(self._qpos[:, self._turning], axis=1).astype(np.float32)
        axes = np.stack([np.cos(angle), np.sin(angle)])
        points, lag = (np.empty((k, *angle.shape), np.float32) for k in (4, 2))
        first = self._earlier is None
        stepped = self._stepped = np.empty(self._qpos.shape, np.float32)
        before = stepped if first else self._earlier
        cut = np.float32(self._geometry.stub_m), *self._cut
        place(self._qpos, self._qvel, before, first, axes, cut, stepped, points, lag)
        (vx, vy), least = points[2:], self._settings.sliding_speed_m_s
        slip = points[2:] / np.sqrt(vx * vx + vy * vy + np.float32(least**2))
        force = -self._friction_n * slip - self._points_kg * lag
        return CableState(axes[:, :, 1:], points[:2], points[2:], slip, force)

    def fastest_rate(self) -> np.ndarray:
        return np.abs(self._qvel).max(axis=1)

    def _bends(self) -> tuple[np.ndarray, np.ndarray]:
        return self._qpos[:, self._hinges], self._qvel[:, self._hinges]

    def keep(self, kept: np.ndarray, active: ActiveEffects) -> None:
        self._active, self._vectors = active, self._vectors[kept]
        self._begin(self._qpos[kept], self._qvel[kept])
        if self._earlier is not None:
            self._earlier = self._earlier[kept]

    def step(self, state: CableState, next_pose: np.ndarray) -> None:
        # a force on a large armature, not an overwritten velocity: the cable's inertia is kept
        wanted = (next_pose - self._qpos[:, :TOOL_DOFS]) / self._step_s
        change = wanted - self._qvel[:, :TOOL_DOFS]
        self._applied[:, :TOOL_DOFS] = change * (TOOL_ARMATURE / self._step_s)
        moments = self._act(state, self._stiffness_n_m2)
        self._damp()
        apply_forces(state.force_n, state.heading, *self._cut, self._qpos, self._applied)
        if moments is not None:
            self._applied[:, self._hinges] += moments
        np.multiply(self._damping[:, TOOL_DOFS:], self._step_s, out=self._armature[:, TOOL_DOFS:])
        self._earlier = self._stepped
        self._time_s += self._step_s
        self._batch.step()

    def _place_masses(self, cable_kg: np.ndarray, tip: np.ndarray, friction: np.ndarray) -> None:
        """Write the masses of every simulation, `tip` the endpoint's, and keep μ m g, (n_sim,)."""
        cable, lengths = self._cable, self._geometry.lengths_m
        n = len(lengths)
        mass = self._distributed(cable_kg[:, None] * (lengths / cable.length_m))
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


class SegmentedRun(ChainRun):
    def _set_parameters(self, vectors: np.ndarray) -> None:
        values = dict(zip(SegmentedSimulator.own, vectors.T, strict=True))
        self._place_masses(values["cable_mass_kg"], values["endpoint_mass_kg"], values["friction"])
        stiffness = values["bending_stiffness_n_m2"][:, None] / self._geometry.bends_m
        stiffness[:, 0] *= values["grip_stiffness"]
        self._set_springs(stiffness, values["axial_stiffness_n"])
        damping_s = values["bending_damping_s"][:, None] + self._total("damping_time")
        self._viscous = damping_s * stiffness
        self._joint_friction = values["joint_friction_n_m"]

    def _damp(self) -> None:
        # the moment M ω/√(ω² + ω₀²) as damping, which MuJoCo integrates implicitly: that keeps a
        # dry joint stable at any step
        rate, slow = self._qvel[:, self._hinges], self._settings.bending_rate_rad_s
        dry = self._joint_friction[:, None] / np.sqrt(rate * rate + slow**2)
        self._damping[:, self._hinges] = self._viscous + dry


class SegmentedSimulator(Simulator):
    """A chain of rigid capsules with springs and dampers in their hinges.

    Its parameters: planar friction μ, the masses of cable and endpoint, the Coulomb moment in
    every joint, the bending stiffness EI, the retardation time η of bending (Kelvin–Voigt: the
    bending moment is EI (κ + η dκ/dt)), how much stiffer than elsewhere the cable bends where it
    leaves the gripper, and the axial stiffness EA. Below half a step η cannot keep a stiff joint
    stable. Length and radius are taken as measured.

    A few segments also stretch: by 0.1 % at the tension of a cast, but that decides what happens
    when a slack cable comes taut. A whip-like cast with E A = 190 N can end more than 10 cm from
    one with an inextensible cable.
    """

    name = "segmented"
    own = (
        "friction", "cable_mass_kg", "endpoint_mass_kg", "joint_friction_n_m",
        "bending_stiffness_n_m2", "bending_damping_s", "grip_stiffness", "axial_stiffness_n",
    )  # fmt: skip
    tunes = ("bending_damping", "bending_hysteresis")  # the latter is the joint friction
    run = SegmentedRun


class HybridRun(ChainRun):
    def _set_parameters(self, vectors: np.ndarray) -> None:
        modulus, friction, endpoint_kg = vectors.T
        self._place_masses(np.full(len(vectors), self._cable.mass_kg), endpoint_kg, friction)
        area = np.pi * self._cable.radius_m**2
        inertia = 0.25 * np.pi * self._cable.radius_m**4
        bending = modulus[:, None] * inertia / self._geometry.bends_m
        self._set_springs(bending, modulus * area)
        damping_s = self._settings.stretch_damping_s + self._total("damping_time")
        self._damping[:, self._hinges] = damping_s * bending


class HybridSimulator(Simulator):
    """A soft round rod with a rigid endpoint.

    One Young's modulus E sets bending and stretching: the bending moment is E I κ and the tension
    E A ε, I = π r⁴/4 and A = π r². Both have the same small material damping: σ = E (ε + η dε/dt)
    (Kelvin–Voigt). Its parameters: Young's modulus of the rod, planar friction μ and the
    endpoint's mass. The rod's length, radius and mass are taken as measured.
    """

    name = "hybrid"
    own = ("youngs_modulus_pa", "friction", "endpoint_mass_kg")
    run = HybridRun
