"""Hidden effects of the virtual rig: the truth that a diagnosis is asked to find.

They act through MuJoCo itself (gravity, medium, contacts, springs, masses) or through forces
written here, on the three-dimensional cable. They share no code with robotcast.effects, whose
classes act on the simulators that diagnose. `mechanisms` holds the effects themselves.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from robotcast.casts.plan import PlannedCast
from robotcast.measurements.measurement_set import Cable
from robotcast.rigs.virtual.cable import TOOL_JOINTS, CableTruth


@dataclass(frozen=True)
class Pieces:
    """The cable's n pieces and its end at one instant, the end, a ball of no length, last."""

    place_m: np.ndarray  # (n, 2), of the points that touch the board
    velocity_m_s: np.ndarray  # (n, 2)
    mass_kg: np.ndarray  # (n,)
    radius_m: np.ndarray  # (n,)
    length_m: np.ndarray  # (n,)
    t_s: float  # since the start of the cast; below zero while the cable settles


class HiddenEffect:
    """Something that the virtual rig does and no model knows of; by itself it changes nothing."""

    def in_cast(self, planned: PlannedCast, number: int) -> "HiddenEffect":
        """Return the effect as it is in cast `number` of a session."""
        return self

    def slipped(self, cable: Cable, planned: PlannedCast) -> Cable:
        """Return the cable as it hangs out of the gripper in a cast."""
        return cable

    def build(self, spec: mujoco.MjSpec, cable: Cable, truth: CableTruth) -> None:
        """Edit the specification of `build_cable` before it is compiled."""

    def hold(self, path: np.ndarray, step_s: float) -> np.ndarray:
        """Return where the end is held (steps, 5) when the logged tool takes `path` (steps, 5)."""
        return path

    def seen_s(self, stamp_s: np.ndarray) -> np.ndarray:
        """Return when the waypoints stamped `stamp_s` (k,) were really seen."""
        return stamp_s

    def seen_m(self, place_m: np.ndarray) -> np.ndarray:
        """Return where the camera puts an end that is at `place_m` (k, 2)."""
        return place_m


class Rubbing(HiddenEffect, ABC):
    """Changes the board's friction from place to place, piece to piece or time to time."""

    @abstractmethod
    def roughness(self, pieces: Pieces) -> np.ndarray:
        """Return the factor (n,) by which each piece's friction is stronger."""


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

        They are bent by `bend_rad` and rest at `rest_rad` now; a segment is `length_m` long.
        """


class Disturbance:
    """Writes frictions, forces and resting angles into a model and its data before each step.

    Places and speeds are those that MuJoCo computed for the step before, one millisecond old.
    """

    def __init__(self, effects: Sequence[HiddenEffect], model: mujoco.MjModel) -> None:
        self._rubbing = [e for e in effects if isinstance(e, Rubbing)]
        self._pushing = [e for e in effects if isinstance(e, Pushing)]
        self._bending = [e for e in effects if isinstance(e, Bending)]
        self._model = model
        first, last = model.body("segment_0").id, model.body("endpoint").id
        self._bodies, segments = slice(first, last + 1), last - first
        self._geoms = np.array([model.body(b).geomadr[0] for b in range(first, last + 1)])
        self._friction = model.geom_friction[self._geoms, 0].copy()
        if self._rubbing:
            # Of two touching geoms the one of higher priority gives the contact its friction.
            model.geom_priority[self._geoms] = 1
        start = len(TOOL_JOINTS)
        self._hinges = slice(start, start + 2 * segments, 2)
        self._length_m = float(model.body("endpoint").pos[0])
        self._lengths_m = np.r_[np.full(segments, self._length_m), 0.0]
        self._masses_kg = model.body_mass[self._bodies]
        self._radii_m = model.geom_size[self._geoms, 0]

    def __call__(self, data: mujoco.MjData) -> None:
        if self._rubbing or self._pushing:
            pieces = self._pieces(data)
        if self._rubbing:
            factors = [effect.roughness(pieces) for effect in self._rubbing]
            self._model.geom_friction[self._geoms, 0] = self._friction * np.prod(factors, axis=0)
        if self._pushing:
            forces = [effect.force_n(pieces) for effect in self._pushing]
            data.xfrc_applied[self._bodies, :2] = np.sum(forces, axis=0)
        for effect in self._bending:
            rest = self._model.qpos_spring[self._hinges]
            rest[:] = effect.rest_rad(data.qpos[self._hinges], rest, self._length_m)

    def _pieces(self, data: mujoco.MjData) -> Pieces:
        place = data.geom_xpos[self._geoms]
        rates = data.cvel[self._bodies]
        # MuJoCo gives velocities about the centre of mass of the whole kinematic tree.
        about = data.subtree_com[self._model.body("tool").id]
        velocity = rates[:, 3:] + np.cross(rates[:, :3], place - about)
        made = (self._masses_kg, self._radii_m, self._lengths_m)
        return Pieces(place[:, :2], velocity[:, :2], *made, t_s=float(data.time))
