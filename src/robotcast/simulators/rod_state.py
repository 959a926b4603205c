"""Where a batch of stretching chains is, and the forces that a board puts on it.

As `chain_state`, for chains whose segments slide along their own axes too: generalised
coordinates are the tool's three, then hinge angle and stretch of one segment after the other.
"""

import numpy as np
from numba import njit

from robotcast.simulators.chain import TOOL_DOFS, ChainGeometry
from robotcast.simulators.chain_state import ChainState, rub

HINGES = slice(TOOL_DOFS, None, 2)
SLIDES = slice(TOOL_DOFS + 1, None, 2)


def rod_state(
    qpos: np.ndarray,
    qvel: np.ndarray,
    earlier: np.ndarray | None,
    geometry: ChainGeometry,
    points_kg: np.ndarray,
    friction_n: np.ndarray,
    sliding_speed_m_s: float,
) -> ChainState:
    """Compute the mass points from generalised coordinates of shape (n_sim, 3 + 2 n).

    Parameters are those of `chain_state`. The state's `stepped` (n_sim, 3 + 2 n) holds the
    tool's two velocities and its turning, then of every segment how fast it turns and stretches.
    """
    n_sim, n_dof = qpos.shape
    stepped = np.empty((n_sim, n_dof), np.float32)
    axes = np.empty((2, n_sim, geometry.half_m.size + 1), np.float32)
    points = np.empty((4, *points_kg.shape), np.float32)
    lag = np.empty((2, *points_kg.shape), np.float32)
    first = earlier is None
    _place(
        qpos,
        qvel,
        stepped if first else earlier,
        first,
        np.float32(geometry.stub_m),
        geometry.half_m,
        axes,
        stepped,
        points,
        lag,
    )
    slip, force = np.empty_like(lag), np.empty_like(lag)
    rub(points, lag, points_kg, friction_n, np.float32(sliding_speed_m_s**2), slip, force)
    return ChainState(axes[:, :, 1:], points[:2], points[2:], slip, force, stepped)


@njit(nogil=True, cache=True)
def _place(qpos, qvel, earlier, first, stub, half, axes, stepped, points, lag):
    """Fill `axes`, `stepped`, `points` (x, y, vx, vy) and the `lag` of every point.

    Centre k = where segment k − 1 ends + (u_k + half_k) along segment k, u the stretch.
    `lag` is the centripetal and Coriolis acceleration −s ω² e + 2 u' ω n, e along the segment
    and n across it, at the extrapolated rates less that at the stepped.
    """
    late, early = np.float32(1.5), np.float32(0.5)
    for i in range(qpos.shape[0]):
        turning, heading = qvel[i, 2], qpos[i, 2]
        stepped[i, 0], stepped[i, 1], stepped[i, 2] = qvel[i, 0], qvel[i, 1], turning
        vx, vy, rate = stepped[i, 0], stepped[i, 1], stepped[i, 2]
        if not first:
            vx = late * vx - early * earlier[i, 0]
            vy = late * vy - early * earlier[i, 1]
            rate = late * rate - early * earlier[i, 2]
        cosine, sine = np.float32(np.cos(heading)), np.float32(np.sin(heading))
        axes[0, i, 0], axes[1, i, 0] = cosine, sine
        x = np.float32(qpos[i, 0]) + stub * cosine
        y = np.float32(qpos[i, 1]) + stub * sine
        vx -= stub * sine * rate
        vy += stub * cosine * rate
        ax, ay = np.float32(0.0), np.float32(0.0)
        for k in range(half.size):
            hinge, slide = 3 + 2 * k, 4 + 2 * k
            heading += qpos[i, hinge]
            turning += qvel[i, hinge]
            cosine, sine = np.float32(np.cos(heading)), np.float32(np.sin(heading))
            axes[0, i, k + 1], axes[1, i, k + 1] = cosine, sine
            stepped[i, hinge], stepped[i, slide] = turning, qvel[i, slide]
            slow, drawn = stepped[i, hinge], stepped[i, slide]
            rate, growth = slow, drawn
            if not first:
                rate = late * slow - early * earlier[i, hinge]
                growth = late * drawn - early * earlier[i, slide]
            behind = slow * slow - rate * rate
            across = np.float32(2.0) * (rate * growth - slow * drawn)
            reach = np.float32(qpos[i, slide]) + half[k]
            hx, hy = reach * cosine, reach * sine
            x, y = x + hx, y + hy
            vx, vy = vx - hy * rate + growth * cosine, vy + hx * rate + growth * sine
            ax, ay = ax + hx * behind - sine * across, ay + hy * behind + cosine * across
            points[0, i, k], points[1, i, k], points[2, i, k], points[3, i, k] = x, y, vx, vy
            lag[0, i, k], lag[1, i, k] = ax, ay
            hx, hy = half[k] * cosine, half[k] * sine
            x, y, vx, vy = x + hx, y + hy, vx - hy * rate, vy + hx * rate
            ax, ay = ax + hx * behind, ay + hy * behind
        n = half.size
        points[0, i, n], points[1, i, n], points[2, i, n], points[3, i, n] = x, y, vx, vy
        lag[0, i, n], lag[1, i, n] = ax, ay


@njit(nogil=True, cache=True)
def apply_rod_forces(force, heading, half, qpos, applied):
    """Write the moments about every hinge, and the pulls on every slide, of forces on points.

    Parameters
    ----------
    force : float32 (2, n_sim, n + 1), on the points of `ChainState`.
    heading : float32 (2, n_sim, n).
    qpos : ndarray of shape (n_sim, 3 + 2 n).
    applied : ndarray of shape (n_sim, 3 + 2 n), whose hinges [N m] and slides [N] are filled.
    """
    n = half.size
    for i in range(force.shape[1]):
        fx, fy = force[0, i, n], force[1, i, n]
        moment = np.float32(0.0)
        for k in range(n - 1, -1, -1):
            tx, ty = heading[0, i, k], heading[1, i, k]
            # what acts past the centre of the segment has a lever longer by its second half
            moment += half[k] * (tx * fy - ty * fx)
            fx, fy = fx + force[0, i, k], fy + force[1, i, k]
            reach = np.float32(qpos[i, 2 * k + 4]) + half[k]
            moment += reach * (tx * fy - ty * fx)
            applied[i, 2 * k + 3] = moment
            applied[i, 2 * k + 4] = tx * fx + ty * fy
