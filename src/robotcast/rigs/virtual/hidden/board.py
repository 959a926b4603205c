"""What can be wrong with the board: its level and its friction."""

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from robotcast.casts.plan import PlannedCast
from robotcast.measurements.measurement_set import Cable
from robotcast.rigs.virtual.cable import CableTruth
from robotcast.rigs.virtual.hidden.effect import Built, Pieces, Rubbing


@dataclass(frozen=True)
class TiltedBoard(Built):
    """The board is not level: gravity leans by `sx`, `sy` times g along x and y."""

    sx: float
    sy: float

    def build(self, spec: mujoco.MjSpec, cable: Cable, truth: CableTruth) -> None:
        g = float(np.linalg.norm(spec.option.gravity))
        down = float(np.sqrt(1 - self.sx**2 - self.sy**2))
        spec.option.gravity = [g * self.sx, g * self.sy, -g * down]


@dataclass(frozen=True)
class RoughPatch(Rubbing):
    """A stain: the friction is 1 + k exp(−d²/w²) times as strong at the distance d from it."""

    k: float
    x_m: float
    y_m: float
    w_m: float

    def roughness(self, pieces: Pieces) -> np.ndarray:
        away = pieces.place_m - np.array([self.x_m, self.y_m])
        return 1 + self.k * np.exp(-np.sum(away**2, axis=1) / self.w_m**2)


@dataclass(frozen=True)
class RoughEnd(Rubbing):
    """The ball at the end is of another material: its friction is 1 + k times the cable's."""

    k: float

    def roughness(self, pieces: Pieces) -> np.ndarray:
        factors = np.ones(len(pieces.place_m))
        factors[-1] += self.k
        return factors


@dataclass(frozen=True)
class SlowGrip(Rubbing):
    """What creeps grips more (Stribeck): friction is 1 + k exp(−(v/vs)²) times as strong.

    A factor above one that falls with speed; MuJoCo's contacts take it one step late, which
    keeps a cable at rest at rest.
    """

    k: float
    vs_m_s: float

    def roughness(self, pieces: Pieces) -> np.ndarray:
        square = np.sum(pieces.velocity_m_s**2, axis=1)
        return 1 + self.k * np.exp(-square / self.vs_m_s**2)


@dataclass(frozen=True)
class Grain(Built):
    """The cable slides 1 + a times as hard across as along itself; the ball at its end does not.

    Every piece touches the board with a short capsule, to whose axis MuJoCo aligns the contact;
    the contact pair then has one coefficient along and one across. Sliding askew, the elliptic
    cone opposes with the force of greatest dissipation.
    """

    a: float

    def build(self, spec: mujoco.MjSpec, cable: Cable, truth: CableTruth) -> None:
        across = truth.friction * (1 + self.a)
        for index in range(truth.segments):
            geom = spec.body(f"segment_{index}").first_geom()
            length = cable.length_m / truth.segments
            geom.type = mujoco.mjtGeom.mjGEOM_CAPSULE
            geom.size = [cable.radius_m, 0.1 * length, 0]
            geom.quat = [np.sqrt(0.5), 0, np.sqrt(0.5), 0]  # from the body's z to its x
            geom.name = f"side_{index}"
            geom.contype = geom.conaffinity = 0
            spec.add_pair(
                geomname1="board",
                geomname2=geom.name,
                condim=3,
                friction=[truth.friction, across, 0, 0, 0],
                solref=[truth.contact_s, 1],
            )


@dataclass(frozen=True)
class WearingBoard(Rubbing):
    """Friction grows over a session of `casts`, by k from the first cast to the last.

    `done` is how far the session has come, 0 to 1.
    """

    k: float
    casts: int
    done: float = 0.0

    def in_cast(self, planned: PlannedCast, number: int) -> "WearingBoard":
        return replace(self, done=number / max(self.casts - 1, 1))

    def roughness(self, pieces: Pieces) -> np.ndarray:
        return np.full(len(pieces.place_m), 1 + self.k * self.done)
