"""The cable of the virtual rig: a three-dimensional chain on a real plane, in MuJoCo.

It is of another make than the simulators that are tuned: it lifts, sags and bounces, and the
board acts on it only through contacts.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from robotcast.measurements.measurement_set import Cable

TOOL_JOINTS = 5  # x, y, height, yaw and pitch of the held end
TOOL_ARMATURE = 1e3  # kg and kg m²: what the cable's pull cannot move
STEEPEST_RAD = 0.8
BOARD_BIT, CABLE_BIT = 1, 2

RECORD_S = 0.002
SETTLE_CAP_S = 1.0
REST_SPEED_M_S, REST_S = 0.005, 0.2


@dataclass(frozen=True)
class CableTruth:
    """What nobody can weigh: how the cable really bends and slides."""

    friction: float  # Coulomb coefficient of cable and endpoint on the board
    bending_stiffness_n_m2: float  # EI
    bending_damping_s: float  # Kelvin–Voigt time, moment = EI (κ + τ dκ/dt)
    hysteresis_n_m: float  # Coulomb moment that opposes bending
    tightest_bend_m: float  # smallest radius of curvature, where the cable's inside is squeezed
    endpoint_radius_m: float  # of the bright round weight at the free end
    segments: int = 30  # rigid pieces of the chain
    step_s: float = 0.001  # halving it moves the resting end by less than the resets scatter it
    contact_s: float = 0.003  # time constant of a contact

    def with_friction(self, factor: float) -> "CableTruth":
        return replace(self, friction=self.friction * factor)


def build_cable(cable: Cable, truth: CableTruth) -> mujoco.MjSpec:
    """Return the held end, the chain and the board as an editable MuJoCo specification.

    `CableRun` moves the held end's joints; every segment hinges about z and about y against the one
    before. A third hinge is left out: the gripper keeps the cable from rolling about its own axis,
    which would let it cross the board without friction.
    """
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    # The pyramidal cone moves the resting end by 5–30 cm, the elliptic one is isotropic.
    option = spec.option
    option.timestep = truth.step_s
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.solver = mujoco.mjtSolver.mjSOL_CG
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = 5
    piece = spec.default.geom
    piece.type, piece.mass = mujoco.mjtGeom.mjGEOM_SPHERE, 0
    piece.contype, piece.conaffinity, piece.condim = CABLE_BIT, BOARD_BIT, 3
    piece.friction, piece.solref = [truth.friction, 0, 0], [truth.contact_s, 1]
    board = spec.worldbody.add_geom(name="board", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1])
    board.contype, board.conaffinity = BOARD_BIT, CABLE_BIT
    body = spec.worldbody.add_body(name="tool", pos=[0, 0, cable.radius_m], explicitinertial=True)
    body.mass, body.ipos, body.inertia = 1e-3, [0, 0, 0], [1e-6] * 3
    for axis in ([1, 0, 0], [0, 1, 0], [0, 0, 1]):
        body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis, armature=TOOL_ARMATURE)
    for axis in ([0, 0, 1], [0, 1, 0]):
        body.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=axis, armature=TOOL_ARMATURE)
    length, mass = cable.length_m / truth.segments, cable.mass_kg / truth.segments
    radius = cable.radius_m
    across = mass * (radius**2 / 4 + length**2 / 12)
    inertia = [mass * radius**2 / 2, across, across]
    for index in range(truth.segments):
        place = (length if index else 0.0, length / 2)
        body = add_piece(body, f"segment_{index}", place, mass, inertia, radius)
        _add_hinges(body, truth, length, first=index == 0)
    # A flat underside, level with the cable's. On a ball as thick as the weight is wide the end
    # would be held up and roll sideways, which drags it by 1–2 % of the cable's length a cast.
    mass = cable.endpoint_mass_kg
    inertia = [0.5 * mass * truth.endpoint_radius_m**2] * 3
    add_piece(body, "endpoint", (length, 0.0), mass, inertia, radius)
    return spec


def compile_cable(spec: mujoco.MjSpec) -> mujoco.MjModel:
    model = spec.compile()
    # MuJoCo scales its stopping rule by the mean inertia; with the tool's huge armature in it the
    # solver would stop early and the end would miss by centimetres.
    model.stat.meaninertia = 1e-3
    return model


def add_piece(
    parent: mujoco.MjsBody,
    name: str,
    place_m: tuple[float, float],
    mass_kg: float,
    inertia: list[float],
    radius_m: float,
) -> mujoco.MjsBody:
    """Add a body that touches the board with a ball about its centre of mass.

    `place_m` is where it begins on its parent's x axis, and where its centre is on its own.
    """
    begin, centre = ([along_m, 0, 0] for along_m in place_m)
    body = parent.add_body(name=name, pos=begin, explicitinertial=True, mass=mass_kg, ipos=centre)
    body.inertia = inertia
    body.add_geom(size=[radius_m, 0, 0], pos=centre)
    return body


def _add_hinges(body: mujoco.MjsBody, truth: CableTruth, length: float, *, first: bool) -> None:
    # Half a segment bends between the gripper and the first segment's middle.
    stiffness = truth.bending_stiffness_n_m2 / length * (2 if first else 1)
    widest = length / truth.tightest_bend_m
    # Lifted past a right angle a segment would point along the hinge about z and spin freely.
    for axis, limit in (([0, 0, 1], widest), ([0, 1, 0], min(widest, STEEPEST_RAD))):
        body.add_joint(
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=axis,
            stiffness=stiffness,
            damping=stiffness * truth.bending_damping_s,
            frictionloss=truth.hysteresis_n_m,
            limited=mujoco.mjtLimited.mjLIMITED_TRUE,
            range=[-limit, limit],
            solref_limit=[truth.contact_s / 2, 1],
        )


@dataclass(frozen=True)
class Motion:
    """What the cable did from the start of its path."""

    t_s: np.ndarray  # (n,), every `RECORD_S`
    nodes_m: np.ndarray  # (n, segments + 1, 3), from the held end to the free end

    @property
    def end_m(self) -> np.ndarray:
        return self.nodes_m[:, -1]  # (n, 3), of the free end


class CableRun:
    """One cable that is laid down along `headings_rad` (segments,) and driven by its held end.

    `held` (5,) is x, y, height above the resting height [m], yaw, pitch [rad] of that end;
    `disturb` is called before every step, to change the model or what acts on the cable.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        headings_rad: np.ndarray,
        held: np.ndarray,
        disturb: Callable[[mujoco.MjData], None] = lambda data: None,
    ) -> None:
        self.model, self.data = model, mujoco.MjData(model)
        self.disturb = disturb
        self._stride = max(1, round(RECORD_S / model.opt.timestep))
        self.data.qpos[:TOOL_JOINTS] = held
        hinges = slice(TOOL_JOINTS, TOOL_JOINTS + 2 * len(headings_rad), 2)
        self.data.qpos[hinges] = np.diff(headings_rad - held[3], prepend=0.0)
        mujoco.mj_forward(model, self.data)

    @property
    def held(self) -> np.ndarray:
        """Pose of the held end now, (5,) as in the constructor."""
        return self.data.qpos[:TOOL_JOINTS].copy()

    def settle(self) -> None:
        """Let the cable come to rest with the held end kept where it is."""
        steps = round(SETTLE_CAP_S / self.model.opt.timestep)
        self.drive(np.tile(self.held, (steps + 1, 1)), moving_s=0.0, start_s=-SETTLE_CAP_S)

    def drive(self, path: np.ndarray, *, moving_s: float, start_s: float = 0.0) -> Motion:
        """Move the held end along `path` and stop when the cable rests.

        `path` (steps + 1, 5) is the held end at every time step, its end the time cap; rest is not
        looked for before `moving_s`. The clock shows `start_s` at first, below zero before a cast.
        """
        model, data, dt = self.model, self.data, self.model.opt.timestep
        velocity = np.diff(path, axis=0) / dt
        recorded, resting_s = [nodes(model, data)], 0.0
        data.time = start_s
        for step in range(1, len(path)):
            # Impressed as a force: overwriting the pose would lose the cable's inertia.
            pull = (velocity[step - 1] - data.qvel[:TOOL_JOINTS]) / dt
            data.qfrc_applied[:TOOL_JOINTS] = TOOL_ARMATURE * pull
            self.disturb(data)
            mujoco.mj_step(model, data)
            if step % self._stride:
                continue
            recorded.append(nodes(model, data))
            speed = np.abs(recorded[-1] - recorded[-2]).max() / (self._stride * dt)
            resting_s = resting_s + self._stride * dt if speed < REST_SPEED_M_S else 0.0
            if resting_s >= REST_S and step * dt >= moving_s + REST_S:
                break
        bad = (f"mjWARN_BAD{of}" for of in ("QPOS", "QVEL", "QACC"))
        if any(data.warning[int(getattr(mujoco.mjtWarning, name))].number for name in bad):
            raise ValueError("virtual rig: the simulated cable diverged")
        return Motion(np.arange(len(recorded)) * self._stride * dt, np.stack(recorded))


def nodes(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """Return the chain's nodes (segments + 1, 3) [m] from the held end to the free end."""
    mujoco.mj_kinematics(model, data)  # a step leaves positions as they were before it
    first, last = model.body("segment_0").id, model.body("endpoint").id
    return data.xpos[first : last + 1].copy()
