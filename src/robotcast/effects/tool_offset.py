"""A tool frame that is not where the cable is held."""

import numpy as np

from robotcast.effects.effect import Effect, Memory


class ToolOffset(Effect):
    """The held point lies (dx, dy) from the logged one, in the tool's frame."""

    def held_pose(
        self, pose: np.ndarray, memory: Memory, step_s: float, *, dx: np.ndarray, dy: np.ndarray
    ) -> np.ndarray:
        x, y, yaw = pose[:, :1], pose[:, 1:2], pose[:, 2:]
        cosine, sine = np.cos(yaw), np.sin(yaw)
        return np.hstack([x + dx * cosine - dy * sine, y + dx * sine + dy * cosine, yaw])
