"""Where a batch of chains in MuJoCo is, and what forces on it do: compiled by Numba.

As NumPy passes over the batch this took a fifth of the time. Positions are in single precision,
which rounds them by 0.1 µm. Shapes: `qpos`, `qvel`, `earlier`, `stepped` and `applied` (n_sim,
n_dof); points (…, n_sim, n + 1). `cut` holds the stub, half the segments' lengths, hinges, slides.
"""

import numpy as np
from numba import njit


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
