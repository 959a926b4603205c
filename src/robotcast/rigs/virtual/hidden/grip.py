"""What can be wrong between the arm's log and the cable: lag and a turned gripper."""

from dataclasses import dataclass

import numpy as np

from robotcast.rigs.virtual.hidden.effect import Holding
from robotcast.rigs.virtual.lag import lagged


@dataclass(frozen=True)
class LooseGrip(Holding):
    """The held end follows the logged tool as a first-order lag of `lag_s`."""

    lag_s: float

    def hold(self, path: np.ndarray, step_s: float) -> np.ndarray:
        # exact for a path that is straight between its samples
        decay = np.exp(-step_s / self.lag_s)
        slope = self.lag_s * (1 - decay) / step_s
        start = path[0]
        weights, past = np.array([1 - slope, slope - decay, 0.0]), np.array([1.0, -decay, 0.0])
        return start + lagged(weights, past, path - start)


@dataclass(frozen=True)
class TurnedGrip(Holding):
    """The cable leaves the gripper at an angle to its logged yaw."""

    angle_rad: float

    def hold(self, path: np.ndarray, step_s: float) -> np.ndarray:
        turned = path.copy()
        turned[:, 3] += self.angle_rad
        return turned
