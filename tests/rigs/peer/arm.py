"""Six joints that follow their target late, and brake when nobody may move them."""

import numpy as np

BRAKE_RAD_S2 = 20.0


class Arm:
    """Joints behind two first-order lags: servoj's look-ahead, then the drives.

    Parameters
    ----------
    joints : ndarray of shape (6,) [rad], where the arm stands.
    lag_s : time constant of the drives.
    """

    def __init__(self, joints: np.ndarray, lag_s: float) -> None:
        self.lag_s = lag_s
        self.place(joints)

    def place(self, joints: np.ndarray) -> None:
        """Stand still elsewhere, as after somebody moved the arm by hand."""
        self.joints = np.array(joints, dtype=float)
        self.told = self.joints.copy()
        self.smoothed = self.joints.copy()
        self.speed = np.zeros(6)
        self.drift = np.zeros(6)

    def follow(self, told: np.ndarray, lookahead_s: float, step_s: float) -> None:
        """Move on by one cycle towards `told` (6,)."""
        self.told = np.array(told)
        before = self.joints
        self.smoothed = self.smoothed + _share(step_s, lookahead_s) * (self.told - self.smoothed)
        aim = self.smoothed + self.drift
        self.joints = before + _share(step_s, self.lag_s) * (aim - before)
        self.speed = (self.joints - before) / step_s

    def brake(self, step_s: float) -> None:
        """Slow down by one cycle and forget what was told."""
        fastest = np.abs(self.speed).max()
        left = max(fastest - BRAKE_RAD_S2 * step_s, 0.0)
        self.speed = self.speed * (left / fastest) if fastest > 0 else np.zeros(6)
        self.joints = self.joints + self.speed * step_s
        self.told, self.smoothed = self.joints.copy(), self.joints.copy()


def _share(step_s: float, lag_s: float) -> float:
    return 1 - float(np.exp(-step_s / lag_s))
