"""What may be hidden in the virtual rig: board, camera, grip, cable, medium; last come mechanisms
that no diagnosis has a name for.
"""

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from robotcast.casts.plan import PlannedCast
from robotcast.measurements.measurement_set import Cable
from robotcast.rigs.virtual.arm import lagged
from robotcast.rigs.virtual.cable import CableTruth, add_piece
from robotcast.rigs.virtual.hidden import Bending, HiddenEffect, Pieces, Pushing, Rubbing

AIR_KG_M3 = 1.2
SMOOTH_BALL = 0.5  # drag coefficient


@dataclass(frozen=True)
class TiltedBoard(HiddenEffect):
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
class Grain(HiddenEffect):
    """The cable slides 1 + a times as hard across as along itself; the ball at its end does not.

    Every piece touches the board with a short capsule, to whose axis MuJoCo aligns the contact;
    the contact pair then has one coefficient along and one across. Sliding askew, the elliptic
    cone opposes with the force of greatest dissipation.
    """

    a: float

    def build(self, spec: mujoco.MjSpec, cable: Cable, truth: CableTruth) -> None:
        length, across = cable.length_m / truth.segments, truth.friction * (1 + self.a)
        friction, solref = [truth.friction, across, 0, 0, 0], [truth.contact_s, 1]
        for index in range(truth.segments):
            geom = spec.body(f"segment_{index}").first_geom()
            geom.type = mujoco.mjtGeom.mjGEOM_CAPSULE
            geom.size = [cable.radius_m, 0.1 * length, 0]
            geom.quat = [np.sqrt(0.5), 0, np.sqrt(0.5), 0]  # from the body's z to its x
            geom.name = f"side_{index}"
            geom.contype = geom.conaffinity = 0
            touching = {"geomname1": "board", "geomname2": geom.name, "condim": 3}
            spec.add_pair(**touching, friction=friction, solref=solref)


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


@dataclass(frozen=True)
class SlowCamera(HiddenEffect):
    """A waypoint is stamped `latency_s` after it was seen."""

    latency_s: float

    def seen_s(self, stamp_s: np.ndarray) -> np.ndarray:
        return stamp_s - self.latency_s


@dataclass(frozen=True)
class MisscaledCamera(HiddenEffect):
    """The camera shows every place 1 + k times as far from the robot's base."""

    k: float

    def seen_m(self, place_m: np.ndarray) -> np.ndarray:
        return (1 + self.k) * place_m


@dataclass(frozen=True)
class TurnedCamera(HiddenEffect):
    """The camera shows every place turned about the robot's base."""

    angle_rad: float

    def seen_m(self, place_m: np.ndarray) -> np.ndarray:
        c, s = np.cos(self.angle_rad), np.sin(self.angle_rad)
        return place_m @ np.array([[c, s], [-s, c]])


@dataclass(frozen=True)
class ShiftedCamera(HiddenEffect):
    """The camera shows every place shifted."""

    dx_m: float
    dy_m: float

    def seen_m(self, place_m: np.ndarray) -> np.ndarray:
        return place_m + np.array([self.dx_m, self.dy_m])


@dataclass(frozen=True)
class DistortingCamera(HiddenEffect):
    """The camera shows every place 1 + k ρ² times as far from the middle of its picture."""

    k: float
    x_m: float
    y_m: float

    def seen_m(self, place_m: np.ndarray) -> np.ndarray:
        apart = place_m - np.array([self.x_m, self.y_m])
        return place_m + self.k * np.sum(apart**2, axis=1, keepdims=True) * apart


@dataclass(frozen=True)
class FastClock(HiddenEffect):
    """The camera's second is 1 / (1 + k) of a second."""

    k: float

    def seen_s(self, stamp_s: np.ndarray) -> np.ndarray:
        return stamp_s / (1 + self.k)


@dataclass(frozen=True)
class LooseGrip(HiddenEffect):
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
class TurnedGrip(HiddenEffect):
    """The cable leaves the gripper at an angle to its logged yaw."""

    angle_rad: float

    def hold(self, path: np.ndarray, step_s: float) -> np.ndarray:
        turned = path.copy()
        turned[:, 3] += self.angle_rad
        return turned


@dataclass(frozen=True)
class ShiftedGrip(HiddenEffect):
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

    def slipped(self, cable: Cable, planned: PlannedCast) -> Cable:
        if planned.action.vmax_m_s <= self.above_m_s:
            return cable
        return replace(cable, length_m=cable.length_m + self.slip_m)


@dataclass(frozen=True)
class UnevenMass(HiddenEffect):
    """Mass per length is 1 + k s times the mean, s from −1 at the hand to 1 at the end."""

    k: float

    def build(self, spec: mujoco.MjSpec, cable: Cable, truth: CableTruth) -> None:
        for index in range(truth.segments):
            body = spec.body(f"segment_{index}")
            factor = 1 + self.k * (2 * (index + 0.5) / truth.segments - 1)
            body.mass *= factor
            body.inertia = body.inertia * factor


@dataclass(frozen=True)
class CurvedCable(HiddenEffect):
    """The cable was stored on a drum: at rest it curves by κ, to the left where κ > 0."""

    curvature_1_m: float

    def build(self, spec: mujoco.MjSpec, cable: Cable, truth: CableTruth) -> None:
        length = cable.length_m / truth.segments
        for index in range(truth.segments):
            # the first hinge stands for the half segment between the gripper and its middle
            bent = length * (0.5 if index == 0 else 1.0)
            spec.body(f"segment_{index}").first_joint().springref = self.curvature_1_m * bent


@dataclass(frozen=True)
class SoftCore(Bending):
    """Bent beyond the yield curvature the cable keeps what is beyond, as a soft wire does."""

    yield_1_m: float

    def rest_rad(self, bend_rad: np.ndarray, rest_rad: np.ndarray, length_m: float) -> np.ndarray:
        lengths = np.full(len(bend_rad), length_m)
        lengths[0] *= 0.5
        most = self.yield_1_m * lengths
        return np.clip(rest_rad, bend_rad - most, bend_rad + most)


@dataclass(frozen=True)
class Air(Pushing):
    """Drag ½ ρ C A v² on every piece of a fuzzy cable, whatever its heading, A = 2 r l.

    The end is smooth and round: C = 0.5 on its own π r². It adds less than a per cent. MuJoCo's
    own medium gives the same forces (the tests compare them), but differentiates them at every
    step and makes a cast five times as slow.
    """

    drag: float

    def force_n(self, pieces: Pieces) -> np.ndarray:
        area = self.drag * 2 * pieces.radius_m * pieces.length_m
        area[-1] = SMOOTH_BALL * np.pi * pieces.radius_m[-1] ** 2
        speed = np.sqrt(np.sum(pieces.velocity_m_s**2, axis=1))
        return -0.5 * AIR_KG_M3 * (area * speed)[:, None] * pieces.velocity_m_s


@dataclass(frozen=True)
class Oil(Pushing):
    """A film on the board that holds every piece back by c m v."""

    rate_1_s: float

    def force_n(self, pieces: Pieces) -> np.ndarray:
        return -self.rate_1_s * pieces.mass_kg[:, None] * pieces.velocity_m_s


@dataclass(frozen=True)
class RubberBand(HiddenEffect):
    """A band pulls the end towards a place on the board: a MuJoCo tendon with stiffness."""

    stiffness_n_m: float
    x_m: float
    y_m: float

    def build(self, spec: mujoco.MjSpec, cable: Cable, truth: CableTruth) -> None:
        spec.worldbody.add_site(name="band_anchor", pos=[self.x_m, self.y_m, cable.radius_m])
        spec.body("endpoint").add_site(name="band_end")
        stiffness = [self.stiffness_n_m, 0, 0]
        band = spec.add_tendon(name="band", stiffness=stiffness, springlength=[0, 0])
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
class SwingingEnd(HiddenEffect):
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
        inertia = [0.5 * mass * truth.endpoint_radius_m**2] * 3
        bob = add_piece(end, "bob", (0.0, self.arm_m), mass, inertia, cable.radius_m)
        bob.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1])


@dataclass(frozen=True)
class WarmingBoard(Rubbing):
    """Rubbing warms the board: in the course of a cast friction nears 1 + k times its first."""

    k: float
    time_s: float

    def roughness(self, pieces: Pieces) -> np.ndarray:
        share = 1 - np.exp(-max(pieces.t_s, 0.0) / self.time_s)
        return np.full(len(pieces.place_m), 1 + self.k * share)
