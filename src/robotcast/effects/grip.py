"""What may be wrong where the tool holds the cable."""

import numpy as np

from robotcast.effects.effect import Effect, Memory

SHARP_M_S = 0.02  # over which the slip sets in, so that a fit can find the speed


class CableSlip(Effect):
    """In casts faster than v the cable has slid out of the gripper and is longer by s."""

    factor = "vmax"

    def in_cast(self, factor: np.ndarray, *, s: np.ndarray, v: np.ndarray) -> dict[str, np.ndarray]:
        faster = np.clip((np.nan_to_num(factor) - v) / SHARP_M_S, -30, 30)
        return {"s": s / (1 + np.exp(-faster))}

    def extra_length(self, *, s: np.ndarray) -> np.ndarray:
        return s


class ToolLag(Effect):
    """The real tool follows the logged one as a first-order lag: τ dx/dt = u − x.

    Exact for a log that is linear over a step.
    """

    def held_pose(
        self, pose: np.ndarray, memory: Memory, step_s: float, *, tau: np.ndarray
    ) -> np.ndarray:
        logged, held = memory.get("logged", pose), memory.get("held", pose)
        decay = np.exp(-step_s / np.maximum(tau, 1e-12))
        behind = tau * (pose - logged) / step_s * (1 - decay)
        held = pose - behind + decay * (held - logged)
        memory["logged"], memory["held"] = pose, held
        return held


class ToolOffset(Effect):
    """The held point lies (dx, dy) from the logged one, in the tool's frame."""

    def held_pose(
        self, pose: np.ndarray, memory: Memory, step_s: float, *, dx: np.ndarray, dy: np.ndarray
    ) -> np.ndarray:
        x, y, yaw = pose[:, :1], pose[:, 1:2], pose[:, 2:]
        cosine, sine = np.cos(yaw), np.sin(yaw)
        return np.hstack([x + dx * cosine - dy * sine, y + dx * sine + dy * cosine, yaw])


class WristOffset(Effect):
    """The cable leaves the gripper at an angle β to its yaw."""

    def held_pose(
        self, pose: np.ndarray, memory: Memory, step_s: float, *, beta: np.ndarray
    ) -> np.ndarray:
        return np.column_stack([pose[:, :2], pose[:, 2:] + beta])
