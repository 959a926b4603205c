"""The bending and twisting springs between the capsules of PyBullet's cable."""

import numpy as np
from numba import njit
from scipy.linalg import eigh

from robotcast.simulators.geometry import capsule_inertia


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
