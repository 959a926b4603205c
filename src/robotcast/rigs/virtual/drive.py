"""Moving the held end of the virtual cable and recording what the cable does."""

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from robotcast.rigs.virtual.cable import TOOL_ARMATURE, TOOL_JOINTS, bend_angles, nodes

RECORD_S = 0.002
SETTLE_CAP_S = 1.0
REST_SPEED_M_S = 0.005
REST_S = 0.2


@dataclass(frozen=True)
class Motion:
    """What the cable did.

    Attributes
    ----------
    t_s : ndarray of shape (n,), every `RECORD_S` from the start of the path.
    nodes_m : ndarray of shape (n, segments + 1, 3), held end first, free end last.
    """

    t_s: np.ndarray
    nodes_m: np.ndarray

    @property
    def end_m(self) -> np.ndarray:
        """Path of the free end, (n, 3)."""
        return self.nodes_m[:, -1]


def undisturbed(data: mujoco.MjData) -> None:
    """Leave the cable to itself."""


class CableRun:
    """One cable that is laid down, settled and then driven by its held end.

    Parameters
    ----------
    headings_rad : ndarray of shape (segments,), directions of the segments on the board.
    held : ndarray of shape (5,), x, y, height above the resting height [m], yaw, pitch [rad].
    disturb : called before every step, to change the model or what acts on the cable.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        headings_rad: np.ndarray,
        held: np.ndarray,
        disturb: Callable[[mujoco.MjData], None] = undisturbed,
    ) -> None:
        self.model, self.data = model, mujoco.MjData(model)
        self.disturb = disturb
        self._stride = max(1, round(RECORD_S / model.opt.timestep))
        count = len(TOOL_JOINTS)
        self.data.qpos[:count] = held
        hinges = slice(count, count + 2 * len(headings_rad), 2)
        self.data.qpos[hinges] = bend_angles(headings_rad - held[3])
        mujoco.mj_forward(model, self.data)

    @property
    def held(self) -> np.ndarray:
        """Pose of the held end now, (5,) as in the constructor."""
        return self.data.qpos[: len(TOOL_JOINTS)].copy()

    def settle(self) -> None:
        """Let the cable come to rest with the held end kept where it is."""
        steps = round(SETTLE_CAP_S / self.model.opt.timestep)
        kept = np.tile(self.held, (steps + 1, 1))
        self.drive(kept, moving_s=0.0, start_s=-SETTLE_CAP_S)

    def drive(self, path: np.ndarray, *, moving_s: float, start_s: float = 0.0) -> Motion:
        """Move the held end along `path` and stop when the cable rests.

        Parameters
        ----------
        path : ndarray of shape (steps + 1, 5), the held end at every time step; its end is
            the time cap.
        moving_s : until when the held end moves; rest is not looked for before.
        start_s : what the clock shows at the start, below zero before a cast begins.
        """
        model, data, dt = self.model, self.data, self.model.opt.timestep
        count = len(TOOL_JOINTS)
        velocity = np.diff(path, axis=0) / dt
        recorded, resting_s = [nodes(model, data)], 0.0
        data.time = start_s
        for step in range(1, len(path)):
            # Impressed as a force: overwriting the pose would lose the cable's inertia.
            pull = (velocity[step - 1] - data.qvel[:count]) / dt
            data.qfrc_applied[:count] = TOOL_ARMATURE * pull
            self.disturb(data)
            mujoco.mj_step(model, data)
            if step % self._stride:
                continue
            recorded.append(nodes(model, data))
            speed = np.abs(recorded[-1] - recorded[-2]).max() / (self._stride * dt)
            resting_s = resting_s + self._stride * dt if speed < REST_SPEED_M_S else 0.0
            if resting_s >= REST_S and step * dt >= moving_s + REST_S:
                break
        self._check()
        times = np.arange(len(recorded)) * self._stride * dt
        return Motion(times, np.stack(recorded))

    def _check(self) -> None:
        bad = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL)
        bad += (mujoco.mjtWarning.mjWARN_BADQACC,)
        if any(self.data.warning[int(kind)].number for kind in bad):
            raise ValueError("virtual rig: the simulated cable diverged")
