"""A planar chain of rigid segments: its geometry, and its MuJoCo model.

The chain lies in the board's plane. Its generalised coordinates are the held end's x, y and
yaw, then one hinge angle per segment.
"""

from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

TOOL_DOFS = 3
TOOL_ARMATURE = 1e4  # kg and kg m²: so large that the cable cannot move the held end


@dataclass(frozen=True)
class ChainGeometry:
    """How a cable is cut into segments and hinges.

    A hinge stands for the bending of the cable around it, and sits in the middle of what it
    stands for. Between segments that is one segment length l. At the gripper it is the first
    l/2, so the first hinge sits at l/4, at the end of a stub that is part of the gripper.

    Attributes
    ----------
    stub_m : distance from the held end to the first hinge.
    lengths_m : ndarray of shape (n,), from each hinge to the next, the last to the free end.
    bends_m : ndarray of shape (n,), the length of cable whose bending each hinge carries.
    """

    stub_m: float
    lengths_m: np.ndarray
    bends_m: np.ndarray

    @classmethod
    def of_cable(cls, length_m: float, segments: int) -> "ChainGeometry":
        """Cut a cable into `segments` of equal length but for the first (see above)."""
        full = length_m / segments
        lengths, bends = np.full(segments, full), np.full(segments, full)
        lengths[0] -= 0.25 * full
        bends[0] = 0.5 * full
        return cls(0.25 * full, lengths, bends)

    @cached_property
    def half_m(self) -> np.ndarray:
        """Half the segments' lengths, float32 (n, 1)."""
        return (0.5 * self.lengths_m).astype(np.float32)[:, None]


@dataclass(frozen=True)
class ChainState:
    """Where the chain's mass points are and how they move, for a batch of simulations.

    The n + 1 points are the segments' centres from hand to end, then the endpoint. Arrays are
    float32 with the simulations last, which NumPy runs through fastest; single precision
    rounds positions by 0.1 µm.

    Attributes
    ----------
    heading : ndarray of shape (n, 2, n_sim), unit vector along each segment.
    position_m : ndarray of shape (n + 1, 2, n_sim).
    velocity_m_s : ndarray of shape (n + 1, 2, n_sim).
    centripetal_lag_m_s2 : ndarray of shape (n + 1, 2, n_sim), the centripetal acceleration of
        the points at the rates of `velocity_m_s` less that at the stepped rates.
    stepped : ndarray of shape (n + 3, n_sim), the velocities that MuJoCo steps from: the tool's
        two, then how fast it and every segment turn.
    """

    heading: np.ndarray
    position_m: np.ndarray
    velocity_m_s: np.ndarray
    centripetal_lag_m_s2: np.ndarray
    stepped: np.ndarray

    @property
    def end_m(self) -> np.ndarray:
        """Position of the free end, (2, n_sim)."""
        return self.position_m[-1]


def chain_state(
    qpos: np.ndarray, qvel: np.ndarray, earlier: np.ndarray | None, geometry: ChainGeometry
) -> ChainState:
    """Compute the mass points from generalised coordinates of shape (n_sim, 3 + n).

    Parameters
    ----------
    qvel : the velocities that MuJoCo steps from, half a step behind `qpos`.
    earlier : `ChainState.stepped` of the step before, None at the first; velocities are
        extrapolated by half a step from the two.
    """
    place, stepped = qpos.T.astype(np.float32), qvel.T.astype(np.float32)
    for k in range(3, len(place)):
        place[k] += place[k - 1]
        stepped[k] += stepped[k - 1]
    velocity = stepped if earlier is None else np.float32(1.5) * stepped - np.float32(0.5) * earlier
    axes = np.empty((len(place) - 2, 2, len(qpos)), np.float32)
    np.cos(place[2:], out=axes[:, 0])
    np.sin(place[2:], out=axes[:, 1])
    heading, rate = axes[1:], velocity[3:]
    half = np.empty((len(heading), 6, len(qpos)), np.float32)  # of a segment: vector, velocity, lag
    np.multiply(heading, geometry.half_m[:, :, None], out=half[:, :2])
    np.multiply(half[:, 1], -rate, out=half[:, 2])
    np.multiply(half[:, 0], rate, out=half[:, 3])
    np.multiply(half[:, :2], (stepped[3:] ** 2 - rate**2)[:, None], out=half[:, 4:])
    stub = axes[0] * np.float32(geometry.stub_m)
    points = np.empty((len(axes), 6, len(qpos)), np.float32)
    np.add(place[:2], stub, out=points[0, :2])
    np.subtract(velocity[0], stub[1] * velocity[2], out=points[0, 2])
    np.add(velocity[1], stub[0] * velocity[2], out=points[0, 3])
    points[0, 4:] = 0
    # centre k = first hinge + Σ_{i<k} 2 half_i + half_k; endpoint = first hinge + Σ_i 2 half_i
    points[0] += half[0]
    np.add(half[:-1], half[1:], out=points[1:-1])
    points[-1] = half[-1]
    for k in range(1, len(points)):
        points[k] += points[k - 1]
    return ChainState(heading, points[:, :2], points[:, 2:4], points[:, 4:], stepped)


def hinge_moments(force_n: np.ndarray, heading: np.ndarray, geometry: ChainGeometry) -> np.ndarray:
    """Return the moments about every hinge of forces at the mass points, (n, n_sim) [N m].

    Parameters
    ----------
    force_n : ndarray of shape (n + 1, 2, n_sim), forces on the points of `ChainState`.
    heading : ndarray of shape (n, 2, n_sim).
    """
    # what acts past the centre of each segment has the lever l about its hinge, the centre l/2
    lever = np.empty_like(heading)
    lever[-1] = force_n[-1]
    for k in range(len(lever) - 2, -1, -1):
        np.add(lever[k + 1], force_n[k + 1], out=lever[k])
    lever += np.float32(0.5) * force_n[:-1]
    lever *= 2 * geometry.half_m[:, :, None]
    moments = heading[:, 0] * lever[:, 1]
    moments -= heading[:, 1] * lever[:, 0]
    for k in range(len(moments) - 2, -1, -1):
        moments[k] += moments[k + 1]
    return moments


def capsule_inertia(mass_kg: np.ndarray, length_m: np.ndarray, radius_m: float) -> np.ndarray:
    """Return the inertia [kg m²] of a solid rod about its centre, across its axis."""
    return mass_kg * (length_m**2 / 12 + radius_m**2 / 4)


def chain_model(geometry: ChainGeometry, step_s: float) -> mujoco.MjModel:
    """Compile the chain: slides x and y and a hinge for the tool, then one hinge a segment.

    No contacts, gravity or constraints: friction and every effect enter as applied forces,
    masses and joint properties are written per simulation.
    """
    spec = mujoco.MjSpec()
    spec.option.timestep = step_s
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    for flag in ("CONSTRAINT", "CONTACT", "GRAVITY", "SENSOR", "AUTORESET"):
        spec.option.disableflags |= int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag}"))
    body = spec.worldbody.add_body(name="tool", mass=1e-3, inertia=[1e-6, 1e-6, 1e-6])
    body.explicitinertial = True
    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    for name, kind, axis in (
        ("x", slide, [1, 0, 0]),
        ("y", slide, [0, 1, 0]),
        ("yaw", hinge, [0, 0, 1]),
    ):
        body.add_joint(name=name, type=kind, axis=axis, armature=TOOL_ARMATURE)
    for k, hinge_m in enumerate((geometry.stub_m, *geometry.lengths_m[:-1])):
        body = body.add_body(
            name=f"segment{k}",
            pos=[hinge_m, 0, 0],
            mass=1e-3,
            inertia=[1e-7, 1e-7, 1e-7],
        )
        body.explicitinertial = True
        body.add_joint(name=f"hinge{k}", type=hinge, axis=[0, 0, 1])
    return spec.compile()
