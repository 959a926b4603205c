"""The five places at which a hidden effect can act on a cast of the virtual rig."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import mujoco
import numpy as np

from robotcast.casts.plan import PlannedCast
from robotcast.measurements.measurement_set import Cable
from robotcast.rigs.virtual.cable import CableTruth


@dataclass(frozen=True)
class Pieces:
    """The cable's pieces and its end at one instant, the end last.

    Attributes
    ----------
    place_m, velocity_m_s : ndarrays of shape (n, 2), of the points that touch the board.
    mass_kg, radius_m, length_m : ndarrays of shape (n,); the end, a ball, has length 0.
    t_s : time since the start of the cast; below zero while the cable settles.
    """

    place_m: np.ndarray
    velocity_m_s: np.ndarray
    mass_kg: np.ndarray
    radius_m: np.ndarray
    length_m: np.ndarray
    t_s: float


class HiddenEffect:
    """Something that the virtual rig does and no model was told."""

    def in_cast(self, planned: PlannedCast, number: int) -> "HiddenEffect":
        """Return the effect as it is in cast `number` of a session."""
        return self

    def dragged(self, cable: Cable, planned: PlannedCast) -> Cable:
        """Return the cable as it hangs out of the gripper in a cast."""
        return cable


class Built(HiddenEffect, ABC):
    """Changes how the cable or the world around it is made."""

    @abstractmethod
    def build(self, spec: mujoco.MjSpec, cable: Cable, truth: CableTruth) -> None:
        """Edit the specification of `build_cable` before it is compiled."""


class Rubbing(HiddenEffect, ABC):
    """Changes the board's friction from place to place, piece to piece or time to time."""

    @abstractmethod
    def roughness(self, pieces: Pieces) -> np.ndarray:
        """Return how many times as strong as elsewhere the friction of each piece is, (n,)."""


class Pushing(HiddenEffect, ABC):
    """Pushes the cable along the board."""

    @abstractmethod
    def force_n(self, pieces: Pieces) -> np.ndarray:
        """Return the force on every piece, (n, 2)."""


class Bending(HiddenEffect, ABC):
    """Changes the shape in which the hinges rest while the cable moves."""

    @abstractmethod
    def rest_rad(self, bend_rad: np.ndarray, rest_rad: np.ndarray, length_m: float) -> np.ndarray:
        """Return the hinges' new resting angles (segments,) about z.

        Parameters
        ----------
        bend_rad, rest_rad : ndarrays of shape (segments,), the angles now and where they rest.
        length_m : of a segment.
        """


class Holding(HiddenEffect, ABC):
    """Stands between the logged tool and the cable's held end."""

    @abstractmethod
    def hold(self, path: np.ndarray, step_s: float) -> np.ndarray:
        """Return where the end is held (steps, 5) when the logged tool takes `path` (steps, 5)."""


class Seeing(HiddenEffect):
    """Stands between the cable and the written waypoints."""

    def seen_s(self, stamp_s: np.ndarray) -> np.ndarray:
        """Return when the waypoints stamped `stamp_s` (k,) were really seen."""
        return stamp_s

    def seen_m(self, place_m: np.ndarray) -> np.ndarray:
        """Return where the camera puts an end that is at `place_m` (k, 2)."""
        return place_m
