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

    The n + 1 points are the segments' centres from hand to end, then the endpoint.

    Attributes
    ----------
    heading : float32 ndarray of shape (2, n, n_sim), unit vector along each segment.
    rate_rad_s : float32 ndarray of shape (n, n_sim), how fast each segment turns.
    position_m : float32 ndarray of shape (2, n + 1, n_sim).
    velocity_m_s : float32 ndarray of shape (2, n + 1, n_sim).
    """

    heading: np.ndarray
    rate_rad_s: np.ndarray
    position_m: np.ndarray
    velocity_m_s: np.ndarray

    @property
    def end_m(self) -> np.ndarray:
        """Position of the free end, (2, n_sim)."""
        return self.position_m[:, -1]


def chain_state(qpos: np.ndarray, qvel: np.ndarray, geometry: ChainGeometry) -> ChainState:
    """Compute the mass points from generalised coordinates of shape (n_sim, 3 + n).

    In single precision: it rounds positions by 0.1 µm, and is several times faster.
    """
    angle = np.ascontiguousarray(qpos.T[2:], dtype=np.float32)
    rate = np.ascontiguousarray(qvel.T[2:], dtype=np.float32)
    _accumulate(angle)
    _accumulate(rate)
    axes = np.empty((2, *angle.shape), np.float32)
    np.cos(angle, out=axes[0])
    np.sin(angle, out=axes[1])
    heading = axes[:, 1:]
    half = np.empty((4, *heading.shape[1:]), np.float32)  # half-segments and their rates of change
    np.multiply(heading, geometry.half_m, out=half[:2])
    np.multiply(half[1], -rate[1:], out=half[2])
    np.multiply(half[0], rate[1:], out=half[3])
    stub = axes[:, 0] * np.float32(geometry.stub_m)
    points = np.empty((4, len(angle), angle.shape[1]), np.float32)
    np.add(qpos.T[:2], stub, out=points[:2, 0])
    np.add(qvel.T[0], -stub[1] * rate[0], out=points[2, 0])
    np.add(qvel.T[1], stub[0] * rate[0], out=points[3, 0])
    points[:, 0] += half[:, 0]
    _sum_along_chain(half, points)
    return ChainState(heading, rate[1:], points[:2], points[2:])


def segment_rates(qvel: np.ndarray) -> np.ndarray:
    """Return how fast each segment turns [rad/s], float32 (n, n_sim), from (n_sim, 3 + n)."""
    rate = np.ascontiguousarray(qvel.T[2:], dtype=np.float32)
    _accumulate(rate)
    return rate[1:]


def centripetal_acceleration(
    heading: np.ndarray, squared_rate: np.ndarray, geometry: ChainGeometry
) -> np.ndarray:
    """Return the acceleration of the mass points that the segments' turning alone makes.

    Parameters
    ----------
    heading : ndarray of shape (2, n, n_sim).
    squared_rate : ndarray of shape (n, n_sim) [rad²/s²].

    Returns
    -------
    ndarray of shape (2, n + 1, n_sim) [m/s²], −Σ l ω² along the segments up to the point.
    """
    half = heading * (squared_rate * -geometry.half_m)
    points = np.empty((2, half.shape[1] + 1, half.shape[2]), np.float32)
    points[:, 0] = half[:, 0]
    _sum_along_chain(half, points)
    return points


def _sum_along_chain(half: np.ndarray, points: np.ndarray) -> None:
    """Add up half-segment vectors: centre k = held end + Σ_{i<k} 2 half_i + half_k.

    `points[:, 0]` holds the first centre already; the last row is the endpoint.
    """
    np.add(half[:, :-1], half[:, 1:], out=points[:, 1:-1])
    points[:, -1] = half[:, -1]
    for k in range(1, points.shape[1]):
        points[:, k] += points[:, k - 1]


def _accumulate(rows: np.ndarray) -> None:
    """Sum rows downwards in place (np.cumsum along axis 0 is ten times slower)."""
    for k in range(1, len(rows)):
        rows[k] += rows[k - 1]


def hinge_moments(
    force_n: np.ndarray, heading: np.ndarray, geometry: ChainGeometry, out: np.ndarray
) -> np.ndarray:
    """Return the moments about every hinge of forces at the mass points.

    Parameters
    ----------
    force_n : ndarray of shape (2, n + 1, n_sim), forces on the points of `ChainState`.
    heading : ndarray of shape (2, n, n_sim).
    out : ndarray of shape (n, n_sim), overwritten with the moments [N m] and returned.
    """
    n = heading.shape[1]
    # the force that acts past the centre of each segment, at lever l, and at it, at lever l/2
    beyond = np.empty_like(heading)
    beyond[:, -1] = force_n[:, -1]
    for k in range(n - 2, -1, -1):
        np.add(beyond[:, k + 1], force_n[:, k + 1], out=beyond[:, k])
    lever = beyond
    lever += np.float32(0.5) * force_n[:, :-1]
    lever *= 2 * geometry.half_m
    np.multiply(heading[0], lever[1], out=out)
    out -= heading[1] * lever[0]
    for k in range(n - 2, -1, -1):
        out[k] += out[k + 1]
    return out


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
