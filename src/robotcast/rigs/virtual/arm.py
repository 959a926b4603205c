"""The arm of the virtual rig: it follows what it is told a little late and not quite fully."""

from dataclasses import dataclass

import numpy as np

from robotcast.casts.tool_motion import ToolMotion
from robotcast.rigs.virtual.lag import lagged


@dataclass(frozen=True)
class ArmDynamics:
    """A second-order lag with a gain error.

    Attributes
    ----------
    lag_s : by how much the tool follows late at constant speed.
    damping : damping ratio of the lag.
    gain_error : fraction by which the excursion from the start pose is too large.
    """

    lag_s: float = 0.02
    damping: float = 0.9
    gain_error: float = -0.004

    def follow(self, told: ToolMotion, t_s: np.ndarray, *, delay_s: float = 0.0) -> np.ndarray:
        """Return the pose (n, 3) the arm really takes at the evenly spaced times `t_s` (n,).

        Parameters
        ----------
        delay_s : how late the arm starts.
        """
        step = t_s[1] - t_s[0]
        start = told.pose[0]
        asked = start + (1 + self.gain_error) * (told.at(t_s - delay_s) - start)
        return lagged(*self._filter(step), asked)

    def _filter(self, step: float) -> tuple[np.ndarray, np.ndarray]:
        # Bilinear transform of ω² / (s² + 2 ζ ω s + ω²), whose lag is 2 ζ / ω.
        k = 2 / step / (2 * self.damping / self.lag_s)
        numerator = np.array([1.0, 2.0, 1.0])
        middle = 2 * self.damping * k
        return numerator, np.array([k * k + middle + 1, 2 - 2 * k * k, k * k - middle + 1])
