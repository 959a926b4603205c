"""What hidden effects do to the cable at every time step."""

from collections.abc import Sequence

import mujoco
import numpy as np

from robotcast.rigs.virtual.cable import TOOL_JOINTS
from robotcast.rigs.virtual.hidden.effect import Bending, HiddenEffect, Pieces, Pushing, Rubbing


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
        self._bodies = slice(first, last + 1)
        self._geoms = np.array([model.body(b).geomadr[0] for b in range(first, last + 1)])
        self._friction = model.geom_friction[self._geoms, 0].copy()
        if self._rubbing:
            # Of two touching geoms the one of higher priority gives the contact its friction.
            model.geom_priority[self._geoms] = 1
        segments = last - first
        start = len(TOOL_JOINTS)
        self._hinges = slice(start, start + 2 * segments, 2)
        self._length_m = float(model.body("endpoint").pos[0])
        self._lengths_m = np.r_[np.full(segments, self._length_m), 0.0]
        self._masses_kg = model.body_mass[self._bodies]
        self._radii_m = model.geom_size[self._geoms, 0]

    def __call__(self, data: mujoco.MjData) -> None:
        """Set what acts in the next step."""
        if self._rubbing or self._pushing:
            pieces = self._pieces(data)
            self._rub(pieces)
            self._push(data, pieces)
        for effect in self._bending:
            rest = self._model.qpos_spring[self._hinges]
            rest[:] = effect.rest_rad(data.qpos[self._hinges], rest, self._length_m)

    def _pieces(self, data: mujoco.MjData) -> Pieces:
        place = data.geom_xpos[self._geoms]
        rates = data.cvel[self._bodies]
        # MuJoCo gives velocities about the centre of mass of the whole kinematic tree.
        about = data.subtree_com[self._model.body("tool").id]
        velocity = rates[:, 3:] + np.cross(rates[:, :3], place - about)
        return Pieces(
            place_m=place[:, :2],
            velocity_m_s=velocity[:, :2],
            mass_kg=self._masses_kg,
            radius_m=self._radii_m,
            length_m=self._lengths_m,
            t_s=float(data.time),
        )

    def _rub(self, pieces: Pieces) -> None:
        if self._rubbing:
            factors = [effect.roughness(pieces) for effect in self._rubbing]
            self._model.geom_friction[self._geoms, 0] = self._friction * np.prod(factors, axis=0)

    def _push(self, data: mujoco.MjData, pieces: Pieces) -> None:
        if self._pushing:
            forces = [effect.force_n(pieces) for effect in self._pushing]
            data.xfrc_applied[self._bodies, :2] = np.sum(forces, axis=0)
