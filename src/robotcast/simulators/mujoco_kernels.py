"""Where a batch of chains in MuJoCo is, and the forces that a board puts on it.

Compiled by Numba, because this is what a step costs beside MuJoCo's own: as NumPy passes over
the batch it took a fifth of the time. Positions are kept in single precision, which rounds them
by 0.1 µm.
"""

import numpy as np
from numba import njit

from robotcast.simulators.chain import CableState, ChainGeometry


def chain_state(
    qpos: np.ndarray,
    qvel: np.ndarray,
    earlier: np.ndarray | None,
    geometry: ChainGeometry,
    points_kg: np.ndarray,
    friction_n: np.ndarray,
    sliding_speed_m_s: float,
) -> tuple[CableState, np.ndarray]:
    """Compute the mass points from generalised coordinates of shape (n_sim, n_dof).

    Parameters
    ----------
    qvel : the velocities that MuJoCo steps from, half a step behind `qpos`.
    earlier : what was returned beside the state in the step before, None at the first; velocities
        are extrapolated by half a step from the two.
    points_kg, friction_n : float32 (n_sim, n + 1), the points' masses and their μ m g.
    sliding_speed_m_s : ε of the regularised Coulomb friction.

    Returns
    -------
    state : its forces are the board's friction and the correction of MuJoCo's centripetal force
        to the rates of `velocity_m_s`.
    stepped : float32 (n_sim, n_dof), the velocities that MuJoCo steps from, with how fast the tool
        and every segment turn in place of how fast their hinges do.
    """
    n_sim, n = len(qpos), geometry.half_m.size
    angle = _accumulated(qpos, geometry.hinges, np.zeros((n_sim, n + 1), np.float32))
    axes = np.empty((2, *angle.shape), np.float32)
    np.cos(angle, out=axes[0])
    np.sin(angle, out=axes[1])
    stepped = np.empty(qpos.shape, np.float32)
    points = np.empty((4, *points_kg.shape), np.float32)
    lag = np.empty((2, *points_kg.shape), np.float32)
    first = earlier is None
    before = stepped if first else earlier
    cut = np.float32(geometry.stub_m), geometry.half_m, geometry.hinges, geometry.slides
    _place(qpos, qvel, before, first, axes, cut, stepped, points, lag)
    slip, force = np.empty_like(lag), np.empty_like(lag)
    _rub(points, lag, points_kg, friction_n, np.float32(sliding_speed_m_s**2), slip, force)
    return CableState(axes[:, :, 1:], points[:2], points[2:], slip, force), stepped


@njit(nogil=True, cache=True)
def _accumulated(qpos: np.ndarray, hinges: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Fill `angle` with the tool's yaw and the segments' headings."""
    for i in range(angle.shape[0]):
        sum_rad = qpos[i, 2]
        angle[i, 0] = sum_rad
        for k in range(hinges.size):
            sum_rad += qpos[i, hinges[k]]
            angle[i, k + 1] = sum_rad
    return angle


@njit(nogil=True, cache=True)
def _place(qpos, qvel, earlier, first, axes, cut, stepped, points, lag):
    """Fill `stepped`, `points` (x, y, vx, vy) and the `lag` of every point.

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
def _rub(points, lag, mass, friction, square_speed, slip, force):
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
def apply_forces(force, heading, half, hinges, slides, qpos, applied):
    """Write the moments about every hinge, and the pulls on every slide, of forces on points.

    `force` (2, n_sim, n + 1), on the points, and `heading` (2, n_sim, n) are float32; of `applied`
    (n_sim, n_dof) the hinges [N m] and slides [N] are filled.
    """
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


@njit(nogil=True, cache=True)
def damp_hinges(qvel, hinges, viscous, coulomb, square_rate, damping):
    """Write the hinges' damping so that it carries the moment M ω/√(ω² + ω₀²) too.

    MuJoCo integrates damping implicitly, which keeps a dry joint stable at any step. Of `damping`
    (n_sim, n_dof) the hinges are filled. `viscous` (n_sim, n) is in N m s, `coulomb` (n_sim,) is M
    [N m], `square_rate` is ω₀² [rad²/s²].
    """
    for i in range(viscous.shape[0]):
        for k in range(hinges.size):
            rate = qvel[i, hinges[k]]
            dry = coulomb[i] / np.sqrt(rate * rate + square_rate)
            damping[i, hinges[k]] = viscous[i, k] + dry
