"""PyBullet's cable: capsules on a plane, joined by springs.

Paper, "Three Simulation Models": PyBullet, with its ten tuned parameters. Bodies, contacts,
friction, damping and joints are Bullet's own, in three dimensions. How the cable is made of
them follows from how PyBullet 3.2.7 works (its C++ sources, and runs beside the segmented
simulator):

- Its springs with six degrees of freedom soften in silence what is too stiff for the step, and no
  call sets their stiffness; motors' gains scale with the mass that they move. So a point-to-point
  constraint holds the displacements, and springs that bend and twist push as torques, computed
  before every step, which is cut until the fastest mode of the springs is well sampled. An implicit
  torque would let a bent cable that friction holds go slack: friction is not known before the step.
- The capsules are separate bodies: as the links of one, with spherical joints, a step took ten
  times as long and more.
- Between two rigid bodies friction is limited apart along and across their motion, so that what
  slides one way can hardly be pushed aside. Against a plane that is a multi-body Bullet limits
  the two together, as Coulomb's law has it.
- Bullet multiplies the lateral frictions of two bodies. The plane's is `dynamic_friction`, the
  endpoint's 1, the capsules' `lateral_friction`. Spinning friction acts only where there is rolling
  friction, whose bounds therefore exclude 0.
- The angular damping of the capsules stills the cable's fast flutter. An explicit damper in the
  springs as strong as a cable's needs a step tens of times shorter: effects that damp bending are
  refused.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache, partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pybullet
from numba import njit
from scipy.linalg import eigh

from robotcast.effects.effect import ActiveEffects
from robotcast.simulators.chain import GRAVITY_M_S2, CableState, Run, capsule_inertia
from robotcast.simulators.simulator import Settings, Simulator

STEP_RATE = 1.5  # step × fastest frequency of the springs; from 2 on an explicit step diverges
HELD_KG = 1e4  # and kg m²: so heavy that the cable cannot move the held end
_PLANE, _CABLE = 1, 2  # collision groups: the cable touches the plane alone
_ALONG_X = (0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5))  # turns a capsule's axis from z to x


@dataclass(frozen=True)
class BulletSettings(Settings):
    """Numerical settings, not tuned; the step is cut for a cable whose springs need it."""

    step_s: float = 0.003
    batch_size: int = field(default=1, init=False)  # a physics client holds one cable
    patience_s: float = 600.0
    iterations: int = 50  # of Bullet's constraint solver in every step


@cache
def physics_client() -> Any:
    """Return PyBullet's functions with the physics client of this process."""
    functions = {name: f for name, f in vars(pybullet).items() if callable(f)}
    client = pybullet.connect(pybullet.DIRECT)
    return SimpleNamespace(**{n: partial(f, physicsClientId=client) for n, f in functions.items()})


class BulletRun(Run):
    """One simulation, in this process's physics client, of which all else is removed.

    The bodies are the held end, one capsule a segment, and the endpoint. Each is a rigid body of
    its own (in Bullet's words, in maximal coordinates), joined to the next by a point-to-point
    constraint, the endpoint by a fixed one. By damping a body's speed dies away as
    exp(−damping · t).
    """

    def _lay(self, pose: np.ndarray, lean_rad: np.ndarray) -> None:
        cable, geometry, n = self._cable, self._geometry, self._settings.segments
        values = dict(zip(BulletSimulator.own, self._vectors[0], strict=True))
        tip_kg, rough = values["endpoint_mass_kg"], values["lateral_friction"]
        capsules_kg = values["cable_mass_kg"] * geometry.lengths_m / cable.length_m
        capsules_kg = self._distributed(capsules_kg[None])[0].astype(float)
        points_kg = np.append(capsules_kg, tip_kg).astype(np.float32)
        friction = values["dynamic_friction"] * np.append(np.full(n, rough), 1.0)
        self._points_kg = points_kg[None]
        self._friction_n = (friction * GRAVITY_M_S2).astype(np.float32) * self._points_kg
        self._bending = values["bending_stiffness_n_m2"] / geometry.bends_m
        self._twisting = values["twist_stiffness_n_m2"] / geometry.bends_m
        masses = geometry.lengths_m, capsules_kg, tip_kg, cable.radius_m
        fastest = fastest_frequency(*masses, self._bending, self._twisting)
        self._parts = max(1, int(np.ceil(self._step_s * fastest / STEP_RATE)))
        self._part_s = self._step_s / self._parts
        self._client, self._bodies = physics_client(), []
        self._lay_board(values["dynamic_friction"])
        self._lay_cable(pose[0], float(pose[0, 2] + lean_rad[0]), capsules_kg, values)
        self._torques, self._bends_rad = np.empty((n + 1, 3)), np.empty(n)
        self._look()

    def _lay_board(self, friction: float) -> None:
        client = self._client
        client.resetSimulation()
        client.setGravity(0.0, 0.0, -GRAVITY_M_S2)
        stepping = {"fixedTimeStep": self._part_s, "numSolverIterations": self._settings.iterations}
        client.setPhysicsEngineParameter(deterministicOverlappingPairs=1, **stepping)
        plane = client.createMultiBody(0.0, client.createCollisionShape(pybullet.GEOM_PLANE))
        client.changeDynamics(plane, -1, lateralFriction=friction)
        client.setCollisionFilterGroupMask(plane, -1, _PLANE, _CABLE)

    def _lay_cable(
        self, pose: np.ndarray, yaw_rad: float, capsules_kg: np.ndarray, values: Mapping[str, float]
    ) -> None:
        """Lay the bodies in a straight line at `yaw_rad` from the held end's `pose` (3,)."""
        client, geometry, radius_m = self._client, self._geometry, self._cable.radius_m
        # spinning and rolling friction are lengths, multiplied by the other's lateral friction; of
        # damping, Bullet takes the share of the speed that is lost in a second
        rough = {
            "spinningFriction": values["spinning_friction_m"],
            "rollingFriction": values["rolling_friction_m"],
            "linearDamping": -np.expm1(-values["linear_damping_per_s"]),
            "angularDamping": -np.expm1(-values["angular_damping_per_s"]),
        }
        self._add(HELD_KG, -1, pose, pose[2], [HELD_KG] * 3, linearDamping=0.0, angularDamping=0.0)
        heading = np.array([np.cos(yaw_rad), np.sin(yaw_rad)])
        near = pose[:2] + geometry.stub_m * np.array([np.cos(pose[2]), np.sin(pose[2])])
        joint = geometry.stub_m  # of the body before, to its far end
        for length, mass in zip(geometry.lengths_m, capsules_kg, strict=True):
            size: Any = {"radius": radius_m, "height": length}
            size["collisionFrameOrientation"] = _ALONG_X
            shape = client.createCollisionShape(pybullet.GEOM_CAPSULE, **size)
            across = float(capsule_inertia(np.array(mass), np.array(length), radius_m))
            inertia = (0.5 * mass * radius_m**2, across, across)
            centre, lateral = near + 0.5 * length * heading, values["lateral_friction"]
            self._add(mass, shape, centre, yaw_rad, inertia, lateralFriction=lateral, **rough)
            self._join(pybullet.JOINT_POINT2POINT, joint, -0.5 * length)
            near, joint = near + length * heading, 0.5 * length
        shape = client.createCollisionShape(pybullet.GEOM_SPHERE, radius=radius_m)
        mass = values["endpoint_mass_kg"]
        inertia = (0.4 * mass * radius_m**2,) * 3
        self._add(mass, shape, near, yaw_rad, inertia, lateralFriction=1.0, **rough)
        self._join(pybullet.JOINT_FIXED, joint, 0.0)

    def _add(
        self, mass_kg: float, shape: int, centre: Any, yaw_rad: float, inertia: Any, **more: float
    ) -> None:
        client, at = self._client, (centre[0], centre[1], self._cable.radius_m)
        turned = client.getQuaternionFromEuler([0.0, 0.0, yaw_rad])
        body = client.createMultiBody(mass_kg, shape, -1, at, turned, useMaximalCoordinates=True)
        # without the mass Bullet would take 0 beside the inertia
        client.changeDynamics(body, -1, mass=mass_kg, localInertiaDiagonal=inertia, **more)
        if shape >= 0:
            client.setCollisionFilterGroupMask(body, -1, _CABLE, _PLANE)
        self._bodies.append(body)

    def _join(self, kind: int, before_m: float, own_m: float) -> None:
        """Join the last two bodies, at these places along their axes."""
        before, body = self._bodies[-2:]
        places = [0.0, 0.0, 1.0], [before_m, 0.0, 0.0], [own_m, 0.0, 0.0]
        self._client.createConstraint(before, -1, body, -1, kind, *places)

    def state(self) -> CableState:
        x, y, z, w = self._quaternions[1:-1].T
        heading = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + z * w)])
        heading /= np.maximum(np.hypot(*heading), 1e-9)
        heading = heading[:, None].astype(np.float32)
        position, velocity = _points(self._position), _points(self._velocity)
        rate = np.sqrt((velocity**2).sum(axis=0) + np.float32(self._settings.sliding_speed_m_s**2))
        return CableState(heading, position, velocity, velocity / rate, np.zeros_like(velocity))

    def fastest_rate(self) -> np.ndarray:
        return np.array([max(np.abs(self._velocity).max(), np.abs(self._turning).max())])

    def _bends(self) -> tuple[np.ndarray, np.ndarray]:
        return self._bends_rad[None], np.diff(self._turning[:-1, 2])[None]

    def keep(self, kept: np.ndarray, active: ActiveEffects) -> None:
        """Go on as before: a run of one simulation that goes on goes on whole."""

    def step(self, state: CableState, next_pose: np.ndarray) -> None:
        moments = self._act(state, (self._bending * self._geometry.bends_m)[None])
        for part in range(self._parts):
            if part:
                self._see_bodies()
            torques = self._torques
            if moments is not None:
                torques = torques.copy()
                torques[1:, 2] += moments[0]
                torques[:-1, 2] -= moments[0]
            self._push(torques, state.force_n[:, 0].T)
            self._drive(next_pose[0], self._step_s - part * self._part_s)
            self._client.stepSimulation()
        self._time_s += self._step_s
        self._look()

    def _push(self, torques: np.ndarray, forces: np.ndarray) -> None:
        """Apply torques (n + 1, 3), but on the held end, and forces (n + 1, 2) on the points."""
        turn, push = self._client.applyExternalTorque, self._client.applyExternalForce
        for body, torque in zip(self._bodies[1:], torques[1:].tolist(), strict=False):
            turn(body, -1, torque, pybullet.WORLD_FRAME)
        if forces.any():
            places = zip(self._bodies[1:], forces.tolist(), self._position[1:], strict=True)
            for body, (x, y), at in places:
                push(body, -1, [x, y, 0.0], at, pybullet.WORLD_FRAME)

    def _drive(self, pose: np.ndarray, left_s: float) -> None:
        """Have the held end move and turn so that it is at `pose` (3,) in `left_s`."""
        position, (x, y, z, w) = self._position[0], self._quaternions[0]
        turn = pose[2] - 2 * np.arctan2(z, w)
        turn = np.arctan2(np.sin(turn), np.cos(turn))
        level = np.array([pose[0], pose[1], self._cable.radius_m]) - position
        velocity, turning = level / left_s, np.array([-2 * x, -2 * y, turn]) / left_s
        held_up = velocity + np.array([0.0, 0.0, GRAVITY_M_S2 * self._part_s])
        self._client.resetBaseVelocity(self._bodies[0], held_up.tolist(), turning.tolist())

    def _look(self) -> None:
        self._see_bodies()
        moving = map(self._client.getBaseVelocity, self._bodies)
        self._velocity, self._turning = (np.array(part) for part in zip(*moving, strict=True))

    def _see_bodies(self) -> None:
        """See where the bodies are and what the springs do there."""
        poses = map(self._client.getBasePositionAndOrientation, self._bodies)
        self._position, self._quaternions = (np.array(part) for part in zip(*poses, strict=True))
        springs = self._bending, self._twisting
        spring_torques(self._quaternions[:-1], *springs, self._torques, self._bends_rad)


def _points(vectors: np.ndarray) -> np.ndarray:
    """Return x and y of capsules and endpoint, float32 (2, 1, n + 1)."""
    return vectors[1:, :2].T[:, None].astype(np.float32)


class BulletSimulator(Simulator):
    """Capsules on a plane in PyBullet, in processes with a physics client each."""

    name = "bullet"
    own = (
        "twist_stiffness_n_m2", "bending_stiffness_n_m2", "cable_mass_kg", "lateral_friction",
        "spinning_friction_m", "rolling_friction_m", "endpoint_mass_kg", "linear_damping_per_s",
        "angular_damping_per_s", "dynamic_friction",
    )  # fmt: skip
    tunes = ("bending_damping",)  # as the capsules' angular damping
    lacks = ("damping_time", "extra_length")
    few = 0  # one takes as long as a batch of the others
    run = BulletRun


@njit(cache=True)
def spring_torques(quaternions, bending, twisting, torques, bends):
    """Fill the springs' torques on every capsule, and the joints' bends in the plane.

    The springs `bending` k and `twisting` c (n,) store ½ k φ² + ½ c τ², φ the angle between the
    axes of neighbours and τ the twist that is left once the bend is undone along the shortest way.
    The bending torque acts about the common normal of the axes, the twisting torque about their
    sum: with (e₁ + e₂) / (1 + e₁·e₂) it does the work c τ dτ (Bergou et al. 2008, "Discrete Elastic
    Rods", the curvature binormal's companion). The `quaternions` (n + 1, 4), x y z w, are of the
    held end and the capsules; `torques` (n + 1, 3) [N m] are in the world's frame, `bends` (n,)
    [rad] positive to the left.
    """
    torques[:] = 0.0
    for k in range(len(bending)):
        a, b = quaternions[k], quaternions[k + 1]
        # q = a⁻¹ b: how the capsule is turned against the one before, in the frame of that one
        x = a[3] * b[0] - a[0] * b[3] - a[1] * b[2] + a[2] * b[1]
        y = a[3] * b[1] + a[0] * b[2] - a[1] * b[3] - a[2] * b[0]
        z = a[3] * b[2] - a[0] * b[1] + a[1] * b[0] - a[2] * b[3]
        w = a[3] * b[3] + a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
        if w < 0.0:
            x, y, z, w = -x, -y, -z, -w
        twist = 2.0 * np.arctan2(x, w)
        e1, e2 = _axis(a), _axis(b)
        cosine = e1[0] * e2[0] + e1[1] * e2[1] + e1[2] * e2[2]
        nx = e1[1] * e2[2] - e1[2] * e2[1]
        ny = e1[2] * e2[0] - e1[0] * e2[2]
        nz = e1[0] * e2[1] - e1[1] * e2[0]
        sine = np.sqrt(nx * nx + ny * ny + nz * nz)
        angle = np.arctan2(sine, cosine)
        per_sine = angle / sine if sine > 1e-9 else 1.0
        bent = -bending[k] * per_sine
        twisted = -twisting[k] * twist / max(1.0 + cosine, 1e-3)
        bends[k] = nz * per_sine
        for i, normal in enumerate((nx, ny, nz)):
            torque = bent * normal + twisted * (e1[i] + e2[i])
            torques[k + 1, i] += torque
            torques[k, i] -= torque


@njit(cache=True, inline="always")
def _axis(q):
    """Return the capsule's axis, the x axis of its frame, in the world."""
    x, y, z, w = q
    return 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w)


def fastest_frequency(
    lengths_m: np.ndarray,
    capsules_kg: np.ndarray,
    endpoint_kg: float,
    radius_m: float,
    bending: np.ndarray,
    twisting: np.ndarray,
) -> float:
    """Return the fastest natural frequency [rad/s] of the straight chain on its springs."""
    n = len(lengths_m)
    joints = np.eye(n) - np.eye(n, k=-1)  # angles of the segments → bends, or twists
    centres = np.tril(np.ones((n, n)), -1) * lengths_m + np.diag(0.5 * lengths_m)
    across = capsule_inertia(capsules_kg, lengths_m, radius_m)
    swing = centres.T @ np.diag(capsules_kg) @ centres + np.diag(across)
    swing += endpoint_kg * np.outer(lengths_m, lengths_m)
    spin = np.diag(0.5 * capsules_kg * radius_m**2)
    squares = [
        eigh(joints.T @ np.diag(springs) @ joints, inertia, eigvals_only=True)[-1]
        for springs, inertia in ((bending, swing), (twisting, spin))
    ]
    return float(np.sqrt(max(squares)))
