"""Hidden effects of the virtual rig: the truth that a diagnosis is asked to find.

They act through MuJoCo itself or through forces written here, on the three-dimensional cable, and
share no code with robotcast.effects, whose classes act on the simulators that diagnose. Effects
that both know have the same names and numbers, in SI units. A mechanism is a function of what it
acts on and of its numbers; where it acts, one word says:

"cable" (cable, planned cast): the cable as it hangs out of the gripper.
"model" (specification, cable, truth): edits the specification before it is compiled.
"hold" (path (steps, 5), time step): where the end is held when the logged tool takes the path.
"stamps" (k,): when the waypoints so stamped were really seen.
"places" (k, 2): where the camera puts an end that is there.
"friction" (pieces): the factor, one or (n,), by which the board's friction is stronger.
"force" (pieces): a force along the board on every piece, (n, 2).
"rest" (bends, resting angles (segments,), segment length): the hinges' new resting angles about z.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from inspect import getfullargspec
from math import prod
from typing import Any

import mujoco
import numpy as np

from robotcast.measurements.measurement_set import Cable
from robotcast.rigs.virtual.cable import TOOL_JOINTS, CableTruth, add_piece, lagged

AIR_KG_M3 = 1.2
SMOOTH_BALL = 0.5  # drag coefficient


@dataclass(frozen=True)
class HiddenEffect:
    """One of `MECHANISMS` with its numbers, such as `("board_tilt", {"sx": 0.0, "sy": -0.03})`.

    Calling it calls the mechanism's function.
    """

    name: str
    numbers: Mapping[str, float]

    def __post_init__(self) -> None:
        if self.name not in MECHANISMS:
            known = ", ".join(sorted(MECHANISMS))
            raise ValueError(f"hidden effect: {self.name} is none of {known}")
        takes = getfullargspec(MECHANISMS[self.name][1]).kwonlyargs
        if sorted(self.numbers) != sorted(takes):
            given = ", ".join(self.numbers)
            raise ValueError(f"hidden effect: {self.name} takes {', '.join(takes)}, got {given}")

    def __call__(self, *acted_on: Any) -> Any:
        return MECHANISMS[self.name][1](*acted_on, **self.numbers)


def acting(effects: Sequence[HiddenEffect], where: str) -> list[HiddenEffect]:
    """Return the effects that act there, in their order."""
    return [effect for effect in effects if MECHANISMS[effect.name][0] == where]


def changed(effects: Sequence[HiddenEffect], where: str, value: Any, *given: Any) -> Any:
    """Return what the effects that act there make of `value`, one after the other."""
    for effect in acting(effects, where):
        value = effect(value, *given)
    return value


@dataclass(frozen=True)
class Pieces:
    """The cable's n pieces and its end at one instant, the end, a ball of no length, last."""

    place_m: np.ndarray  # (n, 2), of the points that touch the board
    velocity_m_s: np.ndarray  # (n, 2)
    mass_kg: np.ndarray  # (n,)
    radius_m: np.ndarray  # (n,)
    length_m: np.ndarray  # (n,)
    t_s: float  # since the start of the cast; below zero while the cable settles
    cast: int = 0  # its number in the session


class Disturbance:
    """Writes frictions, forces and resting angles into a model and its data before each step.

    Places and speeds are those that MuJoCo computed for the step before, one millisecond old.
    """

    def __init__(self, effects: Sequence[HiddenEffect], model: mujoco.MjModel, cast: int) -> None:
        self._model, self._cast = model, cast
        wheres = ("friction", "force", "rest")
        self._rubbing, self._pushing, self._bending = (acting(effects, w) for w in wheres)
        first, last = model.body("segment_0").id, model.body("endpoint").id
        self._bodies, segments = slice(first, last + 1), last - first
        self._geoms = np.array([model.body(b).geomadr[0] for b in range(first, last + 1)])
        self._friction = model.geom_friction[self._geoms, 0].copy()
        if self._rubbing:
            # Of two touching geoms the one of higher priority gives the contact its friction.
            model.geom_priority[self._geoms] = 1
        self._hinges = slice(TOOL_JOINTS, TOOL_JOINTS + 2 * segments, 2)
        self._length_m = float(model.body("endpoint").pos[0])
        lengths = np.r_[np.full(segments, self._length_m), 0.0]
        self._made = model.body_mass[self._bodies], model.geom_size[self._geoms, 0], lengths

    def __call__(self, data: mujoco.MjData) -> None:
        if self._rubbing or self._pushing:
            pieces = self._pieces(data)
            factor = prod(effect(pieces) for effect in self._rubbing)
            self._model.geom_friction[self._geoms, 0] = self._friction * factor
            if self._pushing:
                forces = sum(effect(pieces) for effect in self._pushing)
                data.xfrc_applied[self._bodies, :2] = forces
        for effect in self._bending:
            rest = self._model.qpos_spring[self._hinges]
            rest[:] = effect(data.qpos[self._hinges], rest, self._length_m)

    def _pieces(self, data: mujoco.MjData) -> Pieces:
        place, rates = data.geom_xpos[self._geoms], data.cvel[self._bodies]
        # MuJoCo gives velocities about the centre of mass of the whole kinematic tree.
        about = data.subtree_com[self._model.body("tool").id]
        velocity = rates[:, 3:] + np.cross(rates[:, :3], place - about)
        return Pieces(place[:, :2], velocity[:, :2], *self._made, float(data.time), self._cast)


def board_tilt(spec: mujoco.MjSpec, cable: Cable, truth: CableTruth, *, sx: float, sy: float):
    """The board is not level: gravity leans by `sx`, `sy` times g along x and y."""
    g = float(np.linalg.norm(spec.option.gravity))
    spec.option.gravity = [g * sx, g * sy, -g * float(np.sqrt(1 - sx**2 - sy**2))]


def friction_patch(pieces: Pieces, *, k: float, x0: float, y0: float, w: float) -> np.ndarray:
    """A stain: the friction is 1 + k exp(−d²/w²) times as strong at the distance d from it."""
    away = pieces.place_m - np.array([x0, y0])
    return 1 + k * np.exp(-np.sum(away**2, axis=1) / w**2)


def anisotropic_friction(spec: mujoco.MjSpec, cable: Cable, truth: CableTruth, *, a: float):
    """The cable slides 1 + a times as hard across as along itself; the ball at its end does not.

    Every piece touches the board with a short capsule, to whose axis MuJoCo aligns the contact;
    the contact pair then has one coefficient along and one across. Sliding askew, the elliptic
    cone opposes with the force of greatest dissipation.
    """
    length, across = cable.length_m / truth.segments, truth.friction * (1 + a)
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


def camera_rotation(place_m: np.ndarray, *, phi: float) -> np.ndarray:
    """The camera shows every place turned about the robot's base."""
    c, s = np.cos(phi), np.sin(phi)
    return place_m @ np.array([[c, s], [-s, c]])


def lens_distortion(place_m: np.ndarray, *, x0: float, y0: float, k: float) -> np.ndarray:
    """The camera shows every place 1 + k ρ² times as far from the middle of its picture."""
    apart = place_m - np.array([x0, y0])
    return place_m + k * np.sum(apart**2, axis=1, keepdims=True) * apart


def tool_lag(path: np.ndarray, step_s: float, *, tau: float) -> np.ndarray:
    """The held end follows the logged tool as a first-order lag of `tau`."""
    decay = np.exp(-step_s / tau)
    slope = tau * (1 - decay) / step_s  # exact for a path that is straight between its samples
    weights, past = np.array([1 - slope, slope - decay, 0.0]), np.array([1.0, -decay, 0.0])
    return path[0] + lagged(weights, past, path - path[0])


def tool_offset(path: np.ndarray, step_s: float, *, dx: float, dy: float) -> np.ndarray:
    """The cable is held beside the logged point, in the tool's frame."""
    c, s = np.cos(path[:, 3]), np.sin(path[:, 3])
    shifted = path.copy()
    shifted[:, 0] += c * dx - s * dy
    shifted[:, 1] += s * dx + c * dy
    return shifted


def mass_gradient(spec: mujoco.MjSpec, cable: Cable, truth: CableTruth, *, k: float):
    """Mass per length is 1 + k s times the mean, s from −1 at the hand to 1 at the end."""
    for index in range(truth.segments):
        body = spec.body(f"segment_{index}")
        factor = 1 + k * (2 * (index + 0.5) / truth.segments - 1)
        body.mass *= factor
        body.inertia = body.inertia * factor


def resting_curvature(spec: mujoco.MjSpec, cable: Cable, truth: CableTruth, *, kappa: float):
    """The cable was stored on a drum: at rest it curves by κ, to the left where κ > 0."""
    length = cable.length_m / truth.segments
    for index in range(truth.segments):
        # the first hinge stands for the half segment between the gripper and its middle
        bent = length * (0.5 if index == 0 else 1.0)
        spec.body(f"segment_{index}").first_joint().springref = kappa * bent


def plastic_bending(
    bend_rad: np.ndarray, rest_rad: np.ndarray, length_m: float, *, softness: float
) -> np.ndarray:
    """Bent beyond the curvature 1 / `softness` the cable keeps what is beyond, as a soft wire."""
    lengths = np.full(len(bend_rad), length_m)
    lengths[0] *= 0.5
    most = 1 / softness * lengths
    return np.clip(rest_rad, bend_rad - most, bend_rad + most)


def air_drag(pieces: Pieces, *, C: float) -> np.ndarray:
    """Drag ½ ρ C A v² on every piece of a fuzzy cable, whatever its heading, A = 2 r l.

    The end is smooth and round: C = 0.5 on its own π r². It adds less than a per cent. MuJoCo's
    own medium gives the same forces (the tests compare them), but differentiates them at every
    step and makes a cast five times as slow.
    """
    area = C * 2 * pieces.radius_m * pieces.length_m
    area[-1] = SMOOTH_BALL * np.pi * pieces.radius_m[-1] ** 2
    speed = np.sqrt(np.sum(pieces.velocity_m_s**2, axis=1))
    return -0.5 * AIR_KG_M3 * (area * speed)[:, None] * pieces.velocity_m_s


def sticky_zone(pieces: Pieces, *, c: float, x0: float, y0: float, radius: float) -> np.ndarray:
    """Spilt syrup: within a disc every piece is held back by c m v."""
    inside = np.linalg.norm(pieces.place_m - np.array([x0, y0]), axis=1) < radius
    return -(c * pieces.mass_kg * inside)[:, None] * pieces.velocity_m_s


def draught(pieces: Pieces, *, a: float, heading: float, from_y: float, side: float) -> np.ndarray:
    """A fan beyond y = `from_y` (below it, if `side` is −1) accelerates all by `a` to `heading`."""
    blown = pieces.mass_kg * (side * (pieces.place_m[:, 1] - from_y) > 0)
    return a * blown[:, None] * np.array([np.cos(heading), np.sin(heading)])


def rubber_band(
    spec: mujoco.MjSpec, cable: Cable, truth: CableTruth, *, stiffness: float, x0: float, y0: float
):
    """A band pulls the end towards a place on the board: a MuJoCo tendon with stiffness."""
    spec.worldbody.add_site(name="band_anchor", pos=[x0, y0, cable.radius_m])
    spec.body("endpoint").add_site(name="band_end")
    band = spec.add_tendon(name="band", stiffness=[stiffness, 0, 0], springlength=[0, 0])
    band.wrap_site("band_anchor")
    band.wrap_site("band_end")


def swinging_end(spec: mujoco.MjSpec, cable: Cable, truth: CableTruth, *, share: float, arm: float):
    """A share of the end's mass hangs from it on an arm that swings freely over the board."""
    end = spec.body("endpoint")
    mass = share * end.mass
    end.mass -= mass
    end.inertia = end.inertia * (1 - share)
    inertia = [0.5 * mass * truth.endpoint_radius_m**2] * 3
    bob = add_piece(end, "bob", (0.0, arm), mass, inertia, cable.radius_m)
    bob.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1])


MECHANISMS: dict[str, tuple[str, Callable[..., Any]]] = {
    # a waypoint is stamped tau after it was seen
    "camera_latency": ("stamps", lambda stamp_s, *, tau: stamp_s - tau),
    # the camera's second is 1 / (1 + k) of a second
    "camera_clock": ("stamps", lambda stamp_s, *, k: stamp_s / (1 + k)),
    # the camera shows every place 1 + k times as far from the robot's base, or shifted
    "camera_scale": ("places", lambda place_m, *, k: (1 + k) * place_m),
    "camera_offset": ("places", lambda place_m, *, dx, dy: place_m + np.array([dx, dy])),
    # the cable leaves the gripper at an angle to its logged yaw
    "wrist_offset": ("hold", lambda path, step_s, *, beta: path + beta * np.eye(5)[3]),
    # a film of oil on the board holds every piece back by c m v
    "viscous_friction": ("force", lambda p, *, c: -c * p.mass_kg[:, None] * p.velocity_m_s),
    # the ball at the end is of another material: its friction is 1 + k times the cable's
    "endpoint_friction": ("friction", lambda p, *, k: 1 + k * (p.length_m == 0)),
    # what creeps grips more, one step late, which keeps a cable at rest at rest
    "stribeck_friction": (
        "friction",
        lambda p, *, k, vs: 1 + k * np.exp(-np.sum(p.velocity_m_s**2, axis=1) / vs**2),
    ),
    # in casts faster than v the cable has slid out of the gripper by s
    "cable_slip": (
        "cable",
        lambda c, cast, *, s, v: replace(c, length_m=c.length_m + s * (cast.action.vmax_m_s > v)),
    ),
    # the board wears: friction grows by k over a session of so many casts
    "friction_drift": ("friction", lambda p, *, k, casts: 1 + k * (p.cast / max(casts - 1, 1))),
    # rubbing warms the board: in the course of a cast friction nears 1 + k times its first
    "warming_board": (
        "friction",
        lambda p, *, k, time: 1 + k * (1 - np.exp(-max(p.t_s, 0.0) / time)),
    ),
    "board_tilt": ("model", board_tilt),
    "friction_patch": ("friction", friction_patch),
    "anisotropic_friction": ("model", anisotropic_friction),
    "camera_rotation": ("places", camera_rotation),
    "lens_distortion": ("places", lens_distortion),
    "tool_lag": ("hold", tool_lag),
    "tool_offset": ("hold", tool_offset),
    "mass_gradient": ("model", mass_gradient),
    "resting_curvature": ("model", resting_curvature),
    "plastic_bending": ("rest", plastic_bending),
    "air_drag": ("force", air_drag),
    "sticky_zone": ("force", sticky_zone),
    "draught": ("force", draught),
    "rubber_band": ("model", rubber_band),
    "swinging_end": ("model", swinging_end),
}
"""Name → where it acts, its function."""
