"""A chain of capsules on a plane, in one PyBullet physics client."""

from dataclasses import dataclass

import numpy as np
import pybullet

from robotcast.simulators.geometry import GRAVITY_M_S2, ChainGeometry, capsule_inertia

HELD_KG = 1e4  # and kg m²: so heavy that the cable cannot move the held end
_PLANE, _CABLE = 1, 2  # collision groups: the cable touches the plane alone
_ALONG_X = (0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5))  # turns a capsule's axis from z to x


@dataclass(frozen=True)
class Surfaces:
    """What bodies and plane are like where they touch, and how bodies lose speed.

    Bullet multiplies the two bodies' lateral frictions; rolling and spinning friction are
    lengths, multiplied by the other body's lateral friction. By damping a body's speed dies away
    as exp(−damping · t); Bullet takes the share that is lost in a second.
    """

    plane: float
    lateral: float
    spinning_m: float
    rolling_m: float
    linear_damping_per_s: float
    angular_damping_per_s: float


class BulletChain:
    """The bodies: the held end, one capsule a segment, and the endpoint.

    Each is a rigid body of its own (in Bullet's words, in maximal coordinates), joined to the
    next by a point-to-point constraint, the endpoint by a fixed one.

    Parameters
    ----------
    client : the physics client; all that was in it is removed.
    pose : ndarray of shape (3,), the held end; yaw_rad : the segments' yaw.
    capsules_kg : ndarray of shape (n,).
    iterations : of Bullet's constraint solver, in every step.
    """

    def __init__(
        self,
        client: int,
        geometry: ChainGeometry,
        radius_m: float,
        pose: np.ndarray,
        yaw_rad: float,
        capsules_kg: np.ndarray,
        endpoint_kg: float,
        surfaces: Surfaces,
        *,
        step_s: float,
        iterations: int,
    ) -> None:
        self._client, self._radius_m, self._surfaces = client, radius_m, surfaces
        self._step_s = step_s
        pybullet.resetSimulation(physicsClientId=client)
        pybullet.setGravity(0.0, 0.0, -GRAVITY_M_S2, physicsClientId=client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=step_s,
            numSolverIterations=iterations,
            deterministicOverlappingPairs=1,
            physicsClientId=client,
        )
        self._add_plane()
        heading = np.array([np.cos(yaw_rad), np.sin(yaw_rad)])
        turned = pybullet.getQuaternionFromEuler([0.0, 0.0, yaw_rad])
        stub = geometry.stub_m * np.array([np.cos(pose[2]), np.sin(pose[2])])
        self._held = self._add_held(pose)
        self._bodies = [self._held]
        near, joint = pose[:2] + stub, geometry.stub_m  # of the body before, to its far end
        for length, mass in zip(geometry.lengths_m, capsules_kg, strict=True):
            body = self._add_capsule(near + 0.5 * length * heading, turned, length, mass)
            self._join(body, pybullet.JOINT_POINT2POINT, joint, -0.5 * length)
            near, joint = near + length * heading, 0.5 * length
        endpoint = self._add_endpoint(near, turned, endpoint_kg)
        self._join(endpoint, pybullet.JOINT_FIXED, joint, 0.0)

    def poses(self) -> tuple[np.ndarray, np.ndarray]:
        """Return where all bodies are: positions (n + 2, 3) and quaternions (n + 2, 4)."""
        poses = [
            pybullet.getBasePositionAndOrientation(body, physicsClientId=self._client)
            for body in self._bodies
        ]
        return np.array([p for p, _ in poses]), np.array([q for _, q in poses])

    def velocities(self) -> tuple[np.ndarray, np.ndarray]:
        """Return how all bodies move and turn, two of (n + 2, 3) [m/s, rad/s]."""
        velocities = [
            pybullet.getBaseVelocity(body, physicsClientId=self._client) for body in self._bodies
        ]
        return np.array([v for v, _ in velocities]), np.array([w for _, w in velocities])

    def drive(self, velocity: np.ndarray, turning: np.ndarray) -> None:
        """Set how fast the held end moves (3,) and turns (3,) in the next step."""
        held_up = velocity + np.array([0.0, 0.0, GRAVITY_M_S2 * self._step_s])
        pybullet.resetBaseVelocity(
            self._held, held_up.tolist(), turning.tolist(), physicsClientId=self._client
        )

    def turn(self, torques: np.ndarray) -> None:
        """Apply torques (n + 1, 3) [N m] in the next step; the first, on the held end, is moot."""
        for body, torque in zip(self._bodies[1:], torques[1:].tolist(), strict=False):
            pybullet.applyExternalTorque(
                body, -1, torque, pybullet.WORLD_FRAME, physicsClientId=self._client
            )

    def push(self, forces: np.ndarray, positions: np.ndarray) -> None:
        """Apply forces (n + 1, 2) [N] at the centres of capsules and endpoint in the next step."""
        for body, (x, y), at in zip(
            self._bodies[1:], forces.tolist(), positions[1:].tolist(), strict=True
        ):
            pybullet.applyExternalForce(
                body, -1, [x, y, 0.0], at, pybullet.WORLD_FRAME, physicsClientId=self._client
            )

    def step(self) -> None:
        """Advance one step."""
        pybullet.stepSimulation(physicsClientId=self._client)

    def _add_plane(self) -> None:
        shape = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=self._client)
        plane = pybullet.createMultiBody(0.0, shape, physicsClientId=self._client)
        pybullet.changeDynamics(
            plane, -1, lateralFriction=self._surfaces.plane, physicsClientId=self._client
        )
        self._touch(plane, _PLANE, _CABLE)

    def _add_held(self, pose: np.ndarray) -> int:
        turned = pybullet.getQuaternionFromEuler([0.0, 0.0, pose[2]])
        body = self._add(HELD_KG, -1, (pose[0], pose[1], self._radius_m), turned)
        pybullet.changeDynamics(
            body,
            -1,
            mass=HELD_KG,
            localInertiaDiagonal=[HELD_KG] * 3,
            linearDamping=0.0,
            angularDamping=0.0,
            physicsClientId=self._client,
        )
        return body

    def _add_capsule(
        self, centre: np.ndarray, turned: tuple[float, ...], length_m: float, mass_kg: float
    ) -> int:
        shape = pybullet.createCollisionShape(
            pybullet.GEOM_CAPSULE,
            radius=self._radius_m,
            height=length_m,
            collisionFrameOrientation=_ALONG_X,
            physicsClientId=self._client,
        )
        across = float(capsule_inertia(np.array(mass_kg), np.array(length_m), self._radius_m))
        along = 0.5 * mass_kg * self._radius_m**2
        return self._add_touching(
            mass_kg, shape, centre, turned, (along, across, across), self._surfaces.lateral
        )

    def _add_endpoint(self, centre: np.ndarray, turned: tuple[float, ...], mass_kg: float) -> int:
        shape = pybullet.createCollisionShape(
            pybullet.GEOM_SPHERE, radius=self._radius_m, physicsClientId=self._client
        )
        inertia = 0.4 * mass_kg * self._radius_m**2
        return self._add_touching(mass_kg, shape, centre, turned, (inertia,) * 3, 1.0)

    def _add_touching(
        self,
        mass_kg: float,
        shape: int,
        centre: np.ndarray,
        turned: tuple[float, ...],
        inertia: tuple[float, ...],
        lateral: float,
    ) -> int:
        """Add a body that lies on the plane."""
        body = self._add(mass_kg, shape, (centre[0], centre[1], self._radius_m), turned)
        pybullet.changeDynamics(
            body,
            -1,
            lateralFriction=lateral,
            spinningFriction=self._surfaces.spinning_m,
            rollingFriction=self._surfaces.rolling_m,
            linearDamping=-np.expm1(-self._surfaces.linear_damping_per_s),
            angularDamping=-np.expm1(-self._surfaces.angular_damping_per_s),
            mass=mass_kg,  # without it Bullet would take 0 beside the inertia
            localInertiaDiagonal=inertia,
            physicsClientId=self._client,
        )
        self._touch(body, _CABLE, _PLANE)
        return body

    def _add(
        self, mass_kg: float, shape: int, centre: tuple[float, ...], turned: tuple[float, ...]
    ) -> int:
        return pybullet.createMultiBody(
            mass_kg,
            shape,
            -1,
            centre,
            turned,
            useMaximalCoordinates=True,
            physicsClientId=self._client,
        )

    def _touch(self, body: int, group: int, others: int) -> None:
        pybullet.setCollisionFilterGroupMask(body, -1, group, others, physicsClientId=self._client)

    def _join(self, body: int, kind: int, before_m: float, own_m: float) -> None:
        """Join a body to the last, at these places along their axes."""
        pybullet.createConstraint(
            self._bodies[-1],
            -1,
            body,
            -1,
            kind,
            [0.0, 0.0, 1.0],
            [before_m, 0.0, 0.0],
            [own_m, 0.0, 0.0],
            physicsClientId=self._client,
        )
        self._bodies.append(body)
