"""What can be wrong with the camera: its clock and its calibration."""

from dataclasses import dataclass

import numpy as np

from robotcast.rigs.virtual.hidden.effect import Seeing


@dataclass(frozen=True)
class SlowCamera(Seeing):
    """A waypoint is stamped `latency_s` after it was seen."""

    latency_s: float

    def seen_s(self, stamp_s: np.ndarray) -> np.ndarray:
        return stamp_s - self.latency_s


@dataclass(frozen=True)
class MisscaledCamera(Seeing):
    """The camera shows every place 1 + k times as far from the robot's base."""

    k: float

    def seen_m(self, place_m: np.ndarray) -> np.ndarray:
        return (1 + self.k) * place_m


@dataclass(frozen=True)
class TurnedCamera(Seeing):
    """The camera shows every place turned about the robot's base."""

    angle_rad: float

    def seen_m(self, place_m: np.ndarray) -> np.ndarray:
        c, s = np.cos(self.angle_rad), np.sin(self.angle_rad)
        return place_m @ np.array([[c, s], [-s, c]])


@dataclass(frozen=True)
class ShiftedCamera(Seeing):
    """The camera shows every place shifted."""

    dx_m: float
    dy_m: float

    def seen_m(self, place_m: np.ndarray) -> np.ndarray:
        return place_m + np.array([self.dx_m, self.dy_m])


@dataclass(frozen=True)
class DistortingCamera(Seeing):
    """The camera shows every place 1 + k ρ² times as far from the middle of its picture."""

    k: float
    x_m: float
    y_m: float

    def seen_m(self, place_m: np.ndarray) -> np.ndarray:
        apart = place_m - np.array([self.x_m, self.y_m])
        return place_m + self.k * np.sum(apart**2, axis=1, keepdims=True) * apart


@dataclass(frozen=True)
class FastClock(Seeing):
    """The camera's second is 1 / (1 + k) of a second."""

    k: float

    def seen_s(self, stamp_s: np.ndarray) -> np.ndarray:
        return stamp_s / (1 + self.k)
