"""A cable that is clamped askew."""

import numpy as np

from robotcast.effects.effect import Effect, Memory


class WristOffset(Effect):
    """The cable leaves the gripper at an angle β to its yaw."""

    def held_pose(
        self, pose: np.ndarray, memory: Memory, step_s: float, *, beta: np.ndarray
    ) -> np.ndarray:
        return np.column_stack([pose[:, :2], pose[:, 2:] + beta])
