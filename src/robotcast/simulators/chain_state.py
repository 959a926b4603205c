"""Where a batch of chains is, and the forces that a board puts on it.

Compiled by Numba, because this is what a step costs beside MuJoCo's own: as NumPy passes over
the batch it took a fifth of the time and kept threads waiting for the interpreter. Positions
are kept in single precision, which rounds them by 0.1 µm.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from robotcast.simulators.cable_state import CableState
from robotcast.simulators.chain import TOOL_DOFS, ChainGeometry


@dataclass(frozen=True)
class ChainState(CableState):
    """The mass points of a batch of chains; their forces start as what the board does to them.

    Those are its friction and the correction of MuJoCo's centripetal force to the rates of
    `velocity_m_s`.

    Attributes
    ----------
    stepped : ndarray of shape (n_sim, n + 3), the velocities that MuJoCo steps from: the tool's
        two, then how fast it and every segment turn.
    """

    stepped: np.ndarray


def chain_state(
    qpos: np.ndarray,
    qvel: np.ndarray,
    earlier: np.ndarray | None,
    geometry: ChainGeometry,
    points_kg: np.ndarray,
    friction_n: np.ndarray,
    sliding_speed_m_s: float,
) -> ChainState:
    """Compute the mass points from generalised coordinates of shape (n_sim, 3 + n).

    Parameters
    ----------
    qvel : the velocities that MuJoCo steps from, half a step behind `qpos`.
    earlier : `ChainState.stepped` of the step before, None at the first; velocities are
        extrapolated by half a step from the two.
    points_kg, friction_n : float32 (n_sim, n + 1), the points' masses and their μ m g.
    sliding_speed_m_s : ε of the regularised Coulomb friction.
    """
    angle = _accumulated(qpos, np.zeros((len(qpos), qpos.shape[1] - 2), np.float32))
    axes = np.empty((2, *angle.shape), np.float32)
    np.cos(angle, out=axes[0])
    np.sin(angle, out=axes[1])
    stepped = np.empty((len(qpos), qpos.shape[1]), np.float32)
    points = np.empty((4, *points_kg.shape), np.float32)
    lag = np.empty((2, *points_kg.shape), np.float32)
    first = earlier is None
    _place(
        qpos,
        qvel,
        stepped if first else earlier,
        first,
        axes[0],
        axes[1],
        np.float32(geometry.stub_m),
        geometry.half_m,
        stepped,
        points,
        lag,
    )
    slip, force = np.empty_like(lag), np.empty_like(lag)
    rub(points, lag, points_kg, friction_n, np.float32(sliding_speed_m_s**2), slip, force)
    return ChainState(axes[:, :, 1:], points[:2], points[2:], slip, force, stepped)


@njit(nogil=True, cache=True)
def _accumulated(qpos: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Fill `angle` with the tool's yaw and the segments' headings."""
    for i in range(angle.shape[0]):
        sum_rad = 0.0
        for k in range(angle.shape[1]):
            sum_rad += qpos[i, k + 2]
            angle[i, k] = sum_rad
    return angle


@njit(nogil=True, cache=True)
def _place(qpos, qvel, earlier, first, cosine, sine, stub, half, stepped, points, lag):
    """Fill `stepped`, `points` (x, y, vx, vy) and the centripetal `lag` of every point.

    Centre k = first hinge + Σ_{i<k} 2 half_i + half_k, the endpoint = first hinge + Σ_i 2 half_i.
    `lag` is the centripetal acceleration at the extrapolated rates less that at the stepped.
    """
    n = half.size
    late, early = np.float32(1.5), np.float32(0.5)
    for i in range(qpos.shape[0]):
        stepped[i, 0], stepped[i, 1] = qvel[i, 0], qvel[i, 1]
        turning = 0.0
        for k in range(n + 1):
            turning += qvel[i, k + 2]
            stepped[i, k + 2] = turning
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
            hx, hy = half[k] * cosine[i, k + 1], half[k] * sine[i, k + 1]
            slow = stepped[i, k + 3]
            rate = slow if first else late * slow - early * earlier[i, k + 3]
            behind = slow * slow - rate * rate
            x, y, vx, vy = x + hx, y + hy, vx - hy * rate, vy + hx * rate
            ax, ay = ax + hx * behind, ay + hy * behind
            points[0, i, k], points[1, i, k], points[2, i, k], points[3, i, k] = x, y, vx, vy
            lag[0, i, k], lag[1, i, k] = ax, ay
            x, y, vx, vy = x + hx, y + hy, vx - hy * rate, vy + hx * rate
            ax, ay = ax + hx * behind, ay + hy * behind
        points[0, i, n], points[1, i, n], points[2, i, n], points[3, i, n] = x, y, vx, vy
        lag[0, i, n], lag[1, i, n] = ax, ay


@njit(nogil=True, cache=True)
def rub(points, lag, mass, friction, square_speed, slip, force):
    """Fill `slip` and `force` = −μ m g · slip − m · lag."""
    for i in range(mass.shape[0]):
        for k in range(mass.shape[1]):
            vx, vy = points[2, i, k], points[3, i, k]
            whole = np.sqrt(vx * vx + vy * vy + square_speed)
            sx, sy = vx / whole, vy / whole
            slip[0, i, k], slip[1, i, k] = sx, sy
            force[0, i, k] = -friction[i, k] * sx - mass[i, k] * lag[0, i, k]
            force[1, i, k] = -friction[i, k] * sy - mass[i, k] * lag[1, i, k]


@njit(nogil=True, cache=True)
def apply_forces(force, heading, half, applied):
    """Write the moments about every hinge of forces at the mass points.

    Parameters
    ----------
    force : float32 (2, n_sim, n + 1), on the points of `ChainState`.
    heading : float32 (2, n_sim, n).
    applied : ndarray of shape (n_sim, 3 + n), whose hinges' columns are filled [N m].
    """
    # what acts past the centre of each segment has the lever l about its hinge, the centre l/2
    n = half.size
    for i in range(force.shape[1]):
        fx, fy = force[0, i, n], force[1, i, n]
        moment = np.float32(0.0)
        for k in range(n - 1, -1, -1):
            lx = fx + np.float32(0.5) * force[0, i, k]
            ly = fy + np.float32(0.5) * force[1, i, k]
            lever = np.float32(2.0) * half[k]
            moment += lever * (heading[0, i, k] * ly - heading[1, i, k] * lx)
            applied[i, TOOL_DOFS + k] = moment
            fx, fy = fx + force[0, i, k], fy + force[1, i, k]


@njit(nogil=True, cache=True)
def damp_joints(qvel, viscous, coulomb, square_rate, damping):
    """Write the joints' damping so that it carries the moment M ω/√(ω² + ω₀²) too.

    MuJoCo integrates damping implicitly, which keeps a dry joint stable at any step.

    Parameters
    ----------
    qvel, damping : ndarrays of shape (n_sim, 3 + n), the second is filled.
    viscous : ndarray of shape (n_sim, n) [N m s]; coulomb : (n_sim,), M [N m].
    square_rate : ω₀² [rad²/s²].
    """
    for i in range(viscous.shape[0]):
        for k in range(viscous.shape[1]):
            rate = qvel[i, TOOL_DOFS + k]
            damping[i, TOOL_DOFS + k] = viscous[i, k] + coulomb[i] / np.sqrt(
                rate * rate + square_rate
            )
