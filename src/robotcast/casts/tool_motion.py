"""The motion of the held end of the cable over the board."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class ToolMotion:
    """Pose of the held end in time.

    Attributes
    ----------
    t_s : ndarray of shape (n,), increasing, 0 at the start of the cast.
    pose : ndarray of shape (n, 3): x [m], y [m], yaw [rad, unwrapped]; at yaw 0 the cable
        leaves the gripper along +x.
    """

    t_s: np.ndarray
    pose: np.ndarray

    def at(self, t_s: np.ndarray) -> np.ndarray:
        """Return the pose at times `t_s` (m,) as (m, 3); held constant beyond the ends."""
        return np.stack([np.interp(t_s, self.t_s, column) for column in self.pose.T], axis=-1)

    def mirrored(self) -> "ToolMotion":
        """Return the motion mirrored about the board's axis of symmetry (y → −y)."""
        return ToolMotion(self.t_s, self.pose * np.array([1.0, -1.0, -1.0]))
