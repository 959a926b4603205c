"""A tool that follows its log late."""

import numpy as np

from robotcast.effects.effect import Effect, Memory


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
