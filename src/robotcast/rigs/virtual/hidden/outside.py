"""Mechanisms that no diagnosis has a name for."""

from dataclasses import dataclass

import mujoco
import numpy as np

from robotcast.measurements.measurement_set import Cable
from robotcast.rigs.virtual.cable import BOARD_BIT, CABLE_BIT, CableTruth
from robotcast.rigs.virtual.hidden.effect import Built, Pieces, Pushing, Rubbing


@dataclass(frozen=True)
class RubberBand(Built):
    """A band pulls the end towards a place on the board: a MuJoCo tendon with stiffness."""

    stiffness_n_m: float
    x_m: float
    y_m: float

    def build(self, spec: mujoco.MjSpec, cable: Cable, truth: CableTruth) -> None:
        here = [self.x_m, self.y_m, cable.radius_m]
        spec.worldbody.add_site(name="band_anchor", pos=here)
        spec.body("endpoint").add_site(name="band_end")
        band = spec.add_tendon(
            name="band", stiffness=[self.stiffness_n_m, 0, 0], springlength=[0, 0]
        )
        band.wrap_site("band_anchor")
        band.wrap_site("band_end")


@dataclass(frozen=True)
class StickyZone(Pushing):
    """Spilt syrup: within a disc every piece is held back by c m v."""

    rate_1_s: float
    x_m: float
    y_m: float
    radius_m: float

    def force_n(self, pieces: Pieces) -> np.ndarray:
        away = np.linalg.norm(pieces.place_m - np.array([self.x_m, self.y_m]), axis=1)
        held = self.rate_1_s * pieces.mass_kg * (away < self.radius_m)
        return -held[:, None] * pieces.velocity_m_s


@dataclass(frozen=True)
class Draught(Pushing):
    """A fan blows over the part of the board beyond the line y = `from_y_m` (below it, if
    `side` is −1) and pushes all that is light and heavy there alike, by `acceleration_m_s2`
    towards `heading_rad`.
    """

    acceleration_m_s2: float
    heading_rad: float
    from_y_m: float
    side: float

    def force_n(self, pieces: Pieces) -> np.ndarray:
        blown = pieces.mass_kg * (self.side * (pieces.place_m[:, 1] - self.from_y_m) > 0)
        towards = np.array([np.cos(self.heading_rad), np.sin(self.heading_rad)])
        return self.acceleration_m_s2 * blown[:, None] * towards


@dataclass(frozen=True)
class SwingingEnd(Built):
    """A share of the end's mass hangs from it on an arm that swings freely: a pendulum more.
    The bob slides on the board as the end does.
    """

    share: float
    arm_m: float

    def build(self, spec: mujoco.MjSpec, cable: Cable, truth: CableTruth) -> None:
        end = spec.body("endpoint")
        mass = self.share * end.mass
        end.mass -= mass
        end.inertia = end.inertia * (1 - self.share)
        radius = truth.endpoint_radius_m
        bob = end.add_body(
            name="bob",
            explicitinertial=True,
            mass=mass,
            ipos=[self.arm_m, 0, 0],
            inertia=[0.5 * mass * radius**2] * 3,
        )
        bob.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1])
        bob.add_geom(
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[cable.radius_m, 0, 0],
            pos=[self.arm_m, 0, 0],
            mass=0,
            contype=CABLE_BIT,
            conaffinity=BOARD_BIT,
            friction=[truth.friction, 0, 0],
            condim=3,
            solref=[truth.contact_s, 1],
        )


@dataclass(frozen=True)
class WarmingBoard(Rubbing):
    """Rubbing warms the board: in the course of a cast friction nears 1 + k times its first."""

    k: float
    time_s: float

    def roughness(self, pieces: Pieces) -> np.ndarray:
        share = 1 - np.exp(-max(pieces.t_s, 0.0) / self.time_s)
        return np.full(len(pieces.place_m), 1 + self.k * share)
