"""PyBullet's cable: capsules on a plane, joined by springs.

Paper, "Three Simulation Models": PyBullet, with its ten tuned parameters. Bodies, contacts,
friction, damping and joints are Bullet's own, in three dimensions. How the cable is made of
them follows from how PyBullet 3.2.7 works (its C++ sources, and runs beside the segmented
simulator):

- Its springs with six degrees of freedom exist for rigid bodies only, no call sets their
  stiffness, they push explicitly, and they soften in silence what is too stiff for the step
  (btGeneric6DofSpring2Constraint). Motors do not stand in: their gains scale with the mass that
  they move. So a point-to-point constraint holds the three displacements, and bending and
  twisting springs push as torques, computed before every step. They are explicit too, and their
  stiffness is what its name says: the step is cut until the fastest mode of the springs is well
  sampled. An implicit torque would let a bent cable that friction holds go slack, because
  friction is not known before the step.
- The capsules are separate bodies, not the links of one: with 18 spherical joints such a step took
  ten times as long and more.
- Friction between two rigid bodies is limited apart along and across their motion, so that what
  slides one way can hardly be pushed aside. Against a plane that is a multi-body Bullet limits
  the two together, as Coulomb's law has it, and the cable moves as the segmented one does.
- Bullet multiplies the lateral frictions of two bodies. The plane's is `dynamic_friction`, the
  endpoint's 1, the capsules' `lateral_friction`: the first scales all friction, the second that
  of the cable beside the endpoint's. Spinning friction acts only where there is rolling
  friction, whose bounds therefore exclude 0.
- The springs have no damping of their own: what stills the cable's fast flutter is the angular
  damping of the capsules. An explicit damper as strong as a cable's needs a step tens of times
  shorter, so effects that damp bending are refused.
"""

from collections.abc import Mapping, Sequence
from functools import cache, partial
from typing import Any

import numpy as np
import pybullet
from numba import njit
from scipy.linalg import eigh

from robotcast.simulators.chain import GRAVITY_M_S2, ChainGeometry, capsule_inertia

HELD_KG = 1e4  # and kg m²: so heavy that the cable cannot move the held end
_PLANE, _CABLE = 1, 2  # collision groups: the cable touches the plane alone
_ALONG_X = (0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5))  # turns a capsule's axis from z to x


class PhysicsClient:
    """PyBullet's functions, with a physics client of their own."""

    def __init__(self) -> None:
        self._client = pybullet.connect(pybullet.DIRECT)

    def __getattr__(self, name: str) -> Any:
        return partial(getattr(pybullet, name), physicsClientId=self._client)


@cache
def physics_client() -> PhysicsClient:
    """Return the physics client of this process."""
    return PhysicsClient()


def _board(friction: float, step_s: float, iterations: int) -> PhysicsClient:
    """Return this process's physics client, emptied of all but the board."""
    client = physics_client()
    client.resetSimulation()
    client.setGravity(0.0, 0.0, -GRAVITY_M_S2)
    client.setPhysicsEngineParameter(
        fixedTimeStep=step_s, numSolverIterations=iterations, deterministicOverlappingPairs=1
    )
    plane = client.createMultiBody(0.0, client.createCollisionShape(pybullet.GEOM_PLANE))
    client.changeDynamics(plane, -1, lateralFriction=friction)
    client.setCollisionFilterGroupMask(plane, -1, _PLANE, _CABLE)
    return client


class BulletChain:
    """The bodies: the held end, one capsule a segment, and the endpoint.

    Each is a rigid body of its own (in Bullet's words, in maximal coordinates), joined to the
    next by a point-to-point constraint, the endpoint by a fixed one. All that was in this
    process's physics client is removed.

    Parameters
    ----------
    pose : ndarray of shape (3,), the held end; yaw_rad : the segments' yaw.
    capsules_kg : ndarray of shape (n,).
    values : the simulator's parameters by name, of which this takes the endpoint's mass, frictions
        and dampings. By damping a body's speed dies away as exp(−damping · t).
    iterations : of Bullet's constraint solver, in every step.
    """

    def __init__(
        self,
        geometry: ChainGeometry,
        radius_m: float,
        pose: np.ndarray,
        yaw_rad: float,
        capsules_kg: np.ndarray,
        values: Mapping[str, float],
        *,
        step_s: float,
        iterations: int,
    ) -> None:
        client = self._client = _board(values["dynamic_friction"], step_s, iterations)
        self._radius_m, self._step_s = radius_m, step_s
        # spinning and rolling friction are lengths, multiplied by the other's lateral friction; of
        # damping, Bullet takes the share of the speed that is lost in a second
        rough = {
            "spinningFriction": values["spinning_friction_m"],
            "rollingFriction": values["rolling_friction_m"],
            "linearDamping": -np.expm1(-values["linear_damping_per_s"]),
            "angularDamping": -np.expm1(-values["angular_damping_per_s"]),
        }
        self._bodies: list[int] = []
        self._add(HELD_KG, -1, pose, pose[2], [HELD_KG] * 3, linearDamping=0.0, angularDamping=0.0)
        heading = np.array([np.cos(yaw_rad), np.sin(yaw_rad)])
        near = pose[:2] + geometry.stub_m * np.array([np.cos(pose[2]), np.sin(pose[2])])
        joint = geometry.stub_m  # of the body before, to its far end
        for length, mass in zip(geometry.lengths_m, capsules_kg, strict=True):
            shape = client.createCollisionShape(
                pybullet.GEOM_CAPSULE,
                radius=radius_m,
                height=length,
                collisionFrameOrientation=_ALONG_X,
            )
            across = float(capsule_inertia(np.array(mass), np.array(length), radius_m))
            along = 0.5 * mass * radius_m**2
            centre = near + 0.5 * length * heading
            lateral = values["lateral_friction"]
            inertia = (along, across, across)
            self._add(mass, shape, centre, yaw_rad, inertia, lateralFriction=lateral, **rough)
            self._join(pybullet.JOINT_POINT2POINT, joint, -0.5 * length)
            near, joint = near + length * heading, 0.5 * length
        shape = client.createCollisionShape(pybullet.GEOM_SPHERE, radius=radius_m)
        mass = values["endpoint_mass_kg"]
        inertia = (0.4 * mass * radius_m**2,) * 3
        self._add(mass, shape, near, yaw_rad, inertia, lateralFriction=1.0, **rough)
        self._join(pybullet.JOINT_FIXED, joint, 0.0)
        self._pose, self._velocity = client.getBasePositionAndOrientation, client.getBaseVelocity
        self._torque, self._force = client.applyExternalTorque, client.applyExternalForce
        self._reset_velocity, self.step = client.resetBaseVelocity, client.stepSimulation

    def poses(self) -> tuple[np.ndarray, np.ndarray]:
        """Return where all bodies are: positions (n + 2, 3) and quaternions (n + 2, 4)."""
        poses = [self._pose(body) for body in self._bodies]
        return np.array([p for p, _ in poses]), np.array([q for _, q in poses])

    def velocities(self) -> tuple[np.ndarray, np.ndarray]:
        """Return how all bodies move and turn, two of (n + 2, 3) [m/s, rad/s]."""
        velocities = [self._velocity(body) for body in self._bodies]
        return np.array([v for v, _ in velocities]), np.array([w for _, w in velocities])

    def drive(self, velocity: np.ndarray, turning: np.ndarray) -> None:
        """Set how fast the held end moves (3,) and turns (3,) in the next step."""
        held_up = velocity + np.array([0.0, 0.0, GRAVITY_M_S2 * self._step_s])
        self._reset_velocity(self._bodies[0], held_up.tolist(), turning.tolist())

    def turn(self, torques: np.ndarray) -> None:
        """Apply torques (n + 1, 3) [N m] in the next step; the first, on the held end, is moot."""
        for body, torque in zip(self._bodies[1:], torques[1:].tolist(), strict=False):
            self._torque(body, -1, torque, pybullet.WORLD_FRAME)

    def push(self, forces: np.ndarray, positions: np.ndarray) -> None:
        """Apply forces (n + 1, 2) [N] at the centres of capsules and endpoint in the next step."""
        for body, (x, y), at in zip(
            self._bodies[1:], forces.tolist(), positions[1:].tolist(), strict=True
        ):
            self._force(body, -1, [x, y, 0.0], at, pybullet.WORLD_FRAME)

    def _add(
        self,
        mass_kg: float,
        shape: int,
        centre: np.ndarray,
        yaw_rad: float,
        inertia: Sequence[float],
        **dynamics: float,
    ) -> None:
        at = (centre[0], centre[1], self._radius_m)
        turned = self._client.getQuaternionFromEuler([0.0, 0.0, yaw_rad])
        body = self._client.createMultiBody(
            mass_kg, shape, -1, at, turned, useMaximalCoordinates=True
        )
        # without the mass Bullet would take 0 beside the inertia
        self._client.changeDynamics(
            body, -1, mass=mass_kg, localInertiaDiagonal=inertia, **dynamics
        )
        if shape >= 0:
            self._client.setCollisionFilterGroupMask(body, -1, _CABLE, _PLANE)
        self._bodies.append(body)

    def _join(self, kind: int, before_m: float, own_m: float) -> None:
        """Join the last two bodies, at these places along their axes."""
        before, body = self._bodies[-2:]
        places = [0.0, 0.0, 1.0], [before_m, 0.0, 0.0], [own_m, 0.0, 0.0]
        self._client.createConstraint(before, -1, body, -1, kind, *places)


@njit(cache=True)
def spring_torques(quaternions, bending, twisting, torques, bends):
    """Fill the springs' torques on every capsule, and the joints' bends in the plane.

    The springs store ½ k φ² + ½ c τ², φ the angle between the axes of neighbours and τ the twist
    that is left once the bend is undone along the shortest way. The bending torque acts about
    the common normal of the axes, the twisting torque about their sum: with
    (e₁ + e₂) / (1 + e₁·e₂) it does the work c τ dτ (Bergou et al. 2008, "Discrete Elastic Rods",
    the curvature binormal's companion).

    Parameters
    ----------
    quaternions : ndarray of shape (n + 1, 4), x y z w, of the held end and the capsules.
    bending, twisting : ndarrays of shape (n,), k and c of every joint [N m].
    torques : ndarray of shape (n + 1, 3) [N m], world frame; filled.
    bends : ndarray of shape (n,) [rad], positive to the left; filled.
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
    return (
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y + z * w),
        2.0 * (x * z - y * w),
    )


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
    squares = [
        eigh(joints.T @ np.diag(springs) @ joints, inertia, eigvals_only=True)[-1]
        for springs, inertia in (
            (bending, swing),
            (twisting, np.diag(0.5 * capsules_kg * radius_m**2)),
        )
    ]
    return float(np.sqrt(max(squares)))
