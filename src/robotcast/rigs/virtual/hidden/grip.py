"""What can be wrong between the arm's log and the cable: lag and a turned gripper."""

from dataclasses import dataclass, replace

import numpy as np

from robotcast.casts.plan import PlannedCast
from robotcast.measurements.measurement_set import Cable
from robotcast.rigs.virtual.hidden.effect import HiddenEffect, Holding
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


@dataclass(frozen=True)
class ShiftedGrip(Holding):
    """The cable is held beside the logged point, in the tool's frame."""

    dx_m: float
    dy_m: float

    def hold(self, path: np.ndarray, step_s: float) -> np.ndarray:
        c, s = np.cos(path[:, 3]), np.sin(path[:, 3])
        shifted = path.copy()
        shifted[:, 0] += c * self.dx_m - s * self.dy_m
        shifted[:, 1] += s * self.dx_m + c * self.dy_m
        return shifted


@dataclass(frozen=True)
class LooseClamp(HiddenEffect):
    """In casts faster than `above_m_s` the cable has slid out of the gripper by `slip_m`."""

    slip_m: float
    above_m_s: float

    def dragged(self, cable: Cable, planned: PlannedCast) -> Cable:
        if planned.action.vmax_m_s <= self.above_m_s:
            return cable
        return replace(cable, length_m=cable.length_m + self.slip_m)
