"""Where joints' coordinates stand in qpos, and how free and ball joints turn.

They have one speed fewer than coordinates: a quaternion (w, x, y, z) turns about the axes of its
body. A turn by the vector v, whose length is the angle, leads from q to q ⊗ exp(v / 2).
"""

from typing import Any

import mujoco
import numpy as np

FREE, BALL = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL)


def loose(model: Any) -> np.ndarray:
    """Tell which degrees of freedom, (nv,), are those of free and of ball joints."""
    return np.isin(model.jnt_type[model.dof_jntid], (FREE, BALL))


def turning(model: Any) -> np.ndarray:
    """Tell which degrees of freedom, (nv,), turn a quaternion."""
    kind, first = model.jnt_type[model.dof_jntid], model.jnt_dofadr[model.dof_jntid]
    return (kind == BALL) | ((kind == FREE) & (np.arange(model.nv) - first >= 3))


def coordinates(model: Any) -> np.ndarray:
    """Return where in qpos each degree of freedom moves, (nv,).

    Of a turn it is the element of the quaternion that grows by half of the angle from rest.
    """
    after = np.arange(model.nv) - model.jnt_dofadr[model.dof_jntid]
    return model.jnt_qposadr[model.dof_jntid] + after + turning(model)


def quaternions(model: Any) -> list[tuple[int, int]]:
    """Return where in qpos each quaternion begins, and which is the first dof that turns it."""
    return [
        (int(q) + 3 * (kind == FREE), int(dof) + 3 * (kind == FREE))
        for kind, q, dof in zip(model.jnt_type, model.jnt_qposadr, model.jnt_dofadr, strict=True)
        if kind in (FREE, BALL)
    ]


def moved(model: Any, qpos: np.ndarray, by: np.ndarray) -> np.ndarray:
    """Return positions (n, nq) moved by (n, nv)."""
    found, straight = qpos.copy(), ~turning(model)
    found[:, coordinates(model)[straight]] += by[:, straight]
    for at, dof in quaternions(model):
        found[:, at : at + 4] = turned(qpos[:, at : at + 4], by[:, dof : dof + 3])
    return found


def rates(model: Any, qpos: np.ndarray, step_s: float) -> np.ndarray:
    """Return the velocities (n_sim, n, nv) of positions (n_sim, n, nq) at equal steps."""
    found = np.gradient(qpos[:, :, coordinates(model)], step_s, axis=1)
    for at, dof in quaternions(model):
        q = qpos[:, :, at : at + 4]
        found[:, :, dof : dof + 3] = 2 * _relative(q, np.gradient(q, step_s, axis=1))[..., 1:]
    return found


def turned(q: np.ndarray, by: np.ndarray) -> np.ndarray:
    """Return quaternions (…, 4) turned by vectors (…, 3) in their own axes."""
    half = np.linalg.norm(by, axis=-1, keepdims=True) / 2
    vector = by / 2 * np.sinc(half / np.pi)
    w, v = q[..., :1], q[..., 1:]
    real = w * np.cos(half) - (v * vector).sum(axis=-1, keepdims=True)
    return np.concatenate([real, w * vector + v * np.cos(half) + np.cross(v, vector)], axis=-1)


def turn(q: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the vectors (…, 3) by which quaternions (…, 4) are turned to others, the short way."""
    between = _relative(q, other)
    between = between * np.where(between[..., :1] < 0, -1.0, 1.0)
    sine = np.linalg.norm(between[..., 1:], axis=-1, keepdims=True)
    half = np.arctan2(sine, between[..., :1])
    return 2 * between[..., 1:] * half / np.where(sine > 0, sine, 1.0)


def spin(by: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Return the angular velocity (…, 3) where a turn `by` a small vector changes at a rate."""
    across = np.cross(by, rate)
    return rate - across / 2 + np.cross(by, across) / 6


def rate_of_turn(by: np.ndarray, spinning: np.ndarray) -> np.ndarray:
    """Return the rate at which a turn `by` a small vector changes, by the angular velocity."""
    across = np.cross(by, spinning)
    return spinning + across / 2 + np.cross(by, across) / 12


def _relative(q: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return q⁻¹ ⊗ other."""
    w, v, w2, v2 = q[..., :1], q[..., 1:], other[..., :1], other[..., 1:]
    real = w * w2 + (v * v2).sum(axis=-1, keepdims=True)
    return np.concatenate([real, w * v2 - w2 * v - np.cross(v, v2)], axis=-1)
