"""Equalities of a model: closed chains and coupled joints, and joints whose position follows.

Mimics and the passive joints of a closed chain carry no encoder as a rule. Where they stand follows
from the joints that do, by the model's own equalities.
"""

from collections.abc import Collection
from copy import copy

import mujoco
import numpy as np

from robotcast.robots.names import WIDTH, coordinates

STRIDE_RAD_M = (
    0.1  # by which joints are led from the model's own pose, so that a chain stays closed
)
ROUNDS = 5  # of Newton's method at the end
SETTLED = 1e-10  # rad or m: so near, it ends
OPEN = 0.01  # rad or m that equalities may be missed by, for the noise of joints that are measured
SINGULAR = 1e-6  # of the largest singular value: what is smaller ties nothing


def equalities(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[np.ndarray, ...]:
    """Return what equalities say at the state of data: Jacobian (n, nv), softness, violation (n,).

    Data must have been through `mj_fwdPosition`.
    """
    own = np.flatnonzero(data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY))
    jacobian = np.zeros((data.nefc, model.nv))
    if mujoco.mj_isSparse(model):
        rows = np.repeat(np.arange(data.nefc), data.efc_J_rownnz)
        jacobian[rows, data.efc_J_colind[: len(rows)]] = data.efc_J[: len(rows)]
    else:
        jacobian[:] = data.efc_J.reshape(-1, model.nv)[: data.nefc]
    return jacobian[own], data.efc_R[own], data.efc_pos[own]


def ways(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """Return how all joints move with each alone that equalities leave free, (nv, nv) by rows.

    Each row has 1 for its own joint; of a joint that nothing ties all else is 0.
    """
    jacobian, _, _ = equalities(model, data)
    free = np.eye(model.nv) - np.linalg.pinv(jacobian, rcond=SINGULAR) @ jacobian
    own = np.diag(free)[:, None]
    return np.where(own > SINGULAR, free / np.maximum(own, SINGULAR), np.eye(model.nv))


class Followers:
    """Joints that nobody measures, and whose position follows from those that are `seen`.

    Theirs are `dofs` (n,); `lacking` has the joints that are neither seen nor follow, and of each
    the first coordinate that is not seen.
    """

    def __init__(self, model: mujoco.MjModel, seen: Collection[int]) -> None:
        self._model = copy(model)
        self._model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        self._data = mujoco.MjData(self._model)
        poses = [model.qpos0, *model.key_qpos]
        self._home = min(poses, key=lambda pose: np.abs(self._closing(pose)[1]).max(initial=0.0))
        ends = [*model.jnt_qposadr[1:], model.nq]
        self.lacking: dict[int, int] = {}
        for joint, (first, end) in enumerate(zip(model.jnt_qposadr, ends, strict=True)):
            if unseen := [k for k in range(end - first) if first + k not in seen]:
                self.lacking[joint] = unseen[0]
        single = [joint for joint in self.lacking if model.jnt_type[joint] not in WIDTH]
        tied = self._tied(model.jnt_dofadr[single]) if model.neq else [False] * len(single)
        joints = [joint for joint, follows in zip(single, tied, strict=True) if follows]
        for joint in joints:
            del self.lacking[joint]
        self.dofs, self._at = model.jnt_dofadr[joints], model.jnt_qposadr[joints]

    def _tied(self, dofs: np.ndarray) -> np.ndarray:
        """Tell which degrees of freedom equalities leave no freedom when all others are held."""
        jacobian, _ = self._closing(self._home)
        _, values, axes = np.linalg.svd(jacobian[:, dofs])
        free = axes[(values > SINGULAR * values.max(initial=0.0)).sum() :]
        return np.all(np.abs(free) < SINGULAR, axis=0)

    def settle(self, qpos: np.ndarray, qvel: np.ndarray, near: np.ndarray | None = None) -> bool:
        """Write where the followers stand and how fast they are into one state, (nq,) and (nv,).

        They are led there from `near`, a state that meets the equalities, or from the model's pose.
        Return whether the equalities are met there, but for noise.
        """
        if not len(self.dofs):
            return True
        start = self._home if near is None else near
        here = qpos[self._at] = start[self._at]
        way, tied = qpos - start, self._closing(start)[0].any(axis=0)
        far = np.abs(way[coordinates(self._model)[tied]]).max(initial=0.0)
        strides = int(np.ceil(far / STRIDE_RAD_M))
        for part in [*np.arange(1, strides) / max(strides, 1), *[1.0] * ROUNDS]:
            at = start + part * way
            at[self._at] = here
            jacobian, missed = self._closing(at)
            step = np.linalg.lstsq(jacobian[:, self.dofs], missed, rcond=None)[0]
            here = here - step
            if part == 1.0 and np.abs(step).max() < SETTLED:
                break
        qpos[self._at], qvel[self.dofs] = here, 0.0
        jacobian, missed = self._closing(qpos)
        qvel[self.dofs] = -np.linalg.lstsq(jacobian[:, self.dofs], jacobian @ qvel, rcond=None)[0]
        return bool(np.abs(missed).max() < OPEN)

    def _closing(self, qpos: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        self._data.qpos[:] = qpos
        mujoco.mj_fwdPosition(self._model, self._data)
        jacobian, _, missed = equalities(self._model, self._data)
        return jacobian, missed
