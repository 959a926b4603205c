"""What can be hidden: the names and parameters of effects.md, and how a case draws them.

An effect with a name in the library is drawn with the library's parameters, in their units and
meaning, so that an answer can be compared with a diagnosis number by number.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from robotcast.rigs.virtual.hidden import HiddenEffect
from robotcast.rigs.virtual.mechanisms import (
    Air,
    CurvedCable,
    DistortingCamera,
    Draught,
    FastClock,
    Grain,
    LooseClamp,
    LooseGrip,
    MisscaledCamera,
    Oil,
    RoughEnd,
    RoughPatch,
    RubberBand,
    ShiftedCamera,
    ShiftedGrip,
    SlowCamera,
    SlowGrip,
    SoftCore,
    StickyZone,
    SwingingEnd,
    TiltedBoard,
    TurnedCamera,
    TurnedGrip,
    UnevenMass,
    WarmingBoard,
    WearingBoard,
)

Parameters = dict[str, float]

SESSION = 52  # casts over which friction drifts, as many as the benchmark's sets hold


@dataclass(frozen=True)
class Mechanism:
    """One thing that can be hidden.

    Attributes
    ----------
    make : parameters → the effect on the virtual rig.
    place : draws what the size leaves open (a direction, a sign, a place), as parameters of
        size 1; `strengths` of them are multiplied by the size.
    strengths : parameters that grow with the size.
    start, most : the size with which its fitting to a wanted shift starts, and the largest.
    same_law : whether an effect of this name in the library follows the same law, so that the
        two sizes can be compared.
    """

    make: Callable[..., HiddenEffect]
    place: Callable[[np.random.Generator], Parameters]
    strengths: tuple[str, ...]
    start: float
    most: float
    same_law: bool = True

    def parameters(self, place: Mapping[str, float], size: float) -> Parameters:
        """Return the parameters of the mechanism at `place` with this size."""
        return {k: v * size if k in self.strengths else v for k, v in place.items()}


def _signed(name: str) -> Callable[[np.random.Generator], Parameters]:
    return lambda random: {name: float(random.choice([-1.0, 1.0]))}


def _positive(name: str) -> Callable[[np.random.Generator], Parameters]:
    return lambda random: {name: 1.0}


def _direction(first: str, second: str) -> Callable[[np.random.Generator], Parameters]:
    def place(random: np.random.Generator) -> Parameters:
        heading = random.uniform(-np.pi, np.pi)
        return {first: float(np.cos(heading)), second: float(np.sin(heading))}

    return place


def _spot(random: np.random.Generator) -> Parameters:
    """Draw a place that the ends of many casts cross."""
    x, y = random.uniform(0.75, 1.15), random.uniform(-0.5, 0.5)
    return {"x0": float(x), "y0": float(y)}


def _patch(random: np.random.Generator) -> Parameters:
    return {"k": 1.0, **_spot(random), "w": float(random.uniform(0.15, 0.3))}


def _lens(random: np.random.Generator) -> Parameters:
    x, y = random.uniform(0.7, 0.85), random.uniform(-0.05, 0.05)
    return {"k": float(random.choice([-1.0, 1.0])), "x0": float(x), "y0": float(y)}


def _clamp(random: np.random.Generator) -> Parameters:
    return {"s": 1.0, "v": float(random.uniform(0.7, 1.1))}


def _band(random: np.random.Generator) -> Parameters:
    return {"stiffness": 1.0, **_spot(random)}


def _syrup(random: np.random.Generator) -> Parameters:
    return {"c": 1.0, **_spot(random), "radius": float(random.uniform(0.15, 0.25))}


def _fan(random: np.random.Generator) -> Parameters:
    return {
        "a": 1.0,
        "heading": float(random.uniform(-np.pi, np.pi)),
        "from_y": float(random.uniform(-0.15, 0.15)),
        "side": float(random.choice([-1.0, 1.0])),
    }


LIBRARY: Mapping[str, Mechanism] = {
    "board_tilt": Mechanism(
        lambda sx, sy: TiltedBoard(sx, sy), _direction("sx", "sy"), ("sx", "sy"), 0.01, 0.08
    ),
    "air_drag": Mechanism(lambda C: Air(C), _positive("C"), ("C",), 4.0, 30.0),
    "viscous_friction": Mechanism(lambda c: Oil(c), _positive("c"), ("c",), 0.4, 4.0),
    # MuJoCo's cone opposes sliding askew in another direction than the library's law
    "anisotropic_friction": Mechanism(
        lambda a: Grain(a), _positive("a"), ("a",), 0.4, 2.0, same_law=False
    ),
    "friction_patch": Mechanism(
        lambda k, x0, y0, w: RoughPatch(k, x0, y0, w), _patch, ("k",), 0.5, 3.0
    ),
    "stribeck_friction": Mechanism(
        lambda k, vs: SlowGrip(k, vs),
        lambda random: {"k": 1.0, "vs": float(random.uniform(0.2, 0.6))},
        ("k",),
        0.4,
        2.0,
    ),
    # what bends between the heavy end and the light cable carries some of the end's weight
    "endpoint_friction": Mechanism(
        lambda k: RoughEnd(k), _positive("k"), ("k",), 0.3, 2.0, same_law=False
    ),
    "mass_gradient": Mechanism(lambda k: UnevenMass(k), _signed("k"), ("k",), 0.4, 0.85),
    "resting_curvature": Mechanism(
        lambda kappa: CurvedCable(kappa), _signed("kappa"), ("kappa",), 1.0, 8.0
    ),
    "plastic_bending": Mechanism(
        lambda softness: SoftCore(1 / softness), _positive("softness"), ("softness",), 0.05, 0.4
    ),
    "tool_lag": Mechanism(lambda tau: LooseGrip(tau), _positive("tau"), ("tau",), 0.02, 0.15),
    "wrist_offset": Mechanism(lambda beta: TurnedGrip(beta), _signed("beta"), ("beta",), 0.1, 0.6),
    "camera_latency": Mechanism(lambda tau: SlowCamera(tau), _positive("tau"), ("tau",), 0.02, 0.2),
    "camera_scale": Mechanism(lambda k: MisscaledCamera(k), _signed("k"), ("k",), 0.01, 0.1),
    "camera_rotation": Mechanism(
        lambda phi: TurnedCamera(phi), _signed("phi"), ("phi",), 0.01, 0.2
    ),
    "camera_offset": Mechanism(
        lambda dx, dy: ShiftedCamera(dx, dy), _direction("dx", "dy"), ("dx", "dy"), 0.01, 0.1
    ),
    "lens_distortion": Mechanism(
        lambda k, x0, y0: DistortingCamera(k, x0, y0), _lens, ("k",), 0.05, 0.3
    ),
    "camera_clock": Mechanism(lambda k: FastClock(k), _signed("k"), ("k",), 0.01, 0.1),
    "cable_slip": Mechanism(lambda s, v: LooseClamp(s, v), _clamp, ("s",), 0.01, 0.04),
    "friction_drift": Mechanism(
        lambda k: WearingBoard(k, SESSION), _positive("k"), ("k",), 0.4, 0.8
    ),
    "tool_offset": Mechanism(
        lambda dx, dy: ShiftedGrip(dx, dy), _direction("dx", "dy"), ("dx", "dy"), 0.01, 0.05
    ),
}
"""Effects that a diagnosis can name."""

OUTSIDE: Mapping[str, Mechanism] = {
    "rubber_band": Mechanism(
        lambda stiffness, x0, y0: RubberBand(stiffness, x0, y0), _band, ("stiffness",), 0.02, 0.3
    ),
    "sticky_zone": Mechanism(
        lambda c, x0, y0, radius: StickyZone(c, x0, y0, radius), _syrup, ("c",), 2.0, 30.0
    ),
    "draught": Mechanism(
        lambda a, heading, from_y, side: Draught(a, heading, from_y, side), _fan, ("a",), 0.2, 2.0
    ),
    "swinging_end": Mechanism(
        lambda share, arm: SwingingEnd(share, arm),
        lambda random: {"share": 0.5, "arm": 1.0},
        ("arm",),
        0.04,
        0.12,
    ),
    "warming_board": Mechanism(
        lambda k, time: WarmingBoard(k, time),
        lambda random: {"k": 1.0, "time": float(random.uniform(0.5, 1.0))},
        ("k",),
        0.4,
        3.0,
    ),
}
"""Mechanisms that a diagnosis has no name for."""

MECHANISMS: Mapping[str, Mechanism] = {**LIBRARY, **OUTSIDE}


def make_effect(name: str, parameters: Mapping[str, float]) -> HiddenEffect:
    """Return the hidden effect `name` with these parameters."""
    if name not in MECHANISMS:
        known = ", ".join(MECHANISMS)
        raise ValueError(f"hidden effects: {name} cannot be hidden; what can: {known}")
    return MECHANISMS[name].make(**parameters)
