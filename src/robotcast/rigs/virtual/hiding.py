"""What the virtual rig can hide, how it is drawn from a seed, and sized.

An effect with a name in the library is drawn with the library's parameters, in their units and
meaning, so that an answer can be compared with a diagnosis number by number. This side knows the
virtual rig's hidden effects and nothing of robotcast.effects and robotcast.diagnosis.
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from itertools import count, repeat
from pathlib import Path
from typing import Any

import numpy as np

from robotcast.casts.plan import PlannedCast
from robotcast.files import unseal
from robotcast.rigs.virtual.mechanisms import HiddenEffect
from robotcast.rigs.virtual.rig import SLOWEST_S, VirtualRig, seen_places
from robotcast.sessions import SESSION_FILE, read_session

PERIOD_S = 0.1  # between the waypoints that say how far an effect moves the paths
NEAR = 0.1  # a shift within 10 % of the wanted one will do
TRIALS = 4
LEAST_STEP, MOST_STEP = 0.2, 4.0

Parameters = dict[str, float]
Draw = Callable[[np.random.Generator], float | tuple[float, float]]


def _size(random: np.random.Generator) -> float:
    return 1.0


def _signed(random: np.random.Generator) -> float:
    return float(random.choice([-1.0, 1.0]))


def _direction(random: np.random.Generator) -> tuple[float, float]:
    heading = random.uniform(-np.pi, np.pi)
    return float(np.cos(heading)), float(np.sin(heading))


def _between(low: float, high: float) -> Draw:
    return lambda random: float(random.uniform(low, high))


@dataclass(frozen=True)
class Mechanism:
    """One thing that can be hidden.

    `draws` says of every parameter, or two with a space between, how it is drawn for size 1. Those
    drawn by `_size`, `_signed` or `_direction` grow with the size.
    """

    draws: Mapping[str, Draw]
    start: float  # the size with which its fitting to a wanted shift starts
    most: float  # the largest size
    same_law: bool = True  # as the library's effect of this name: the sizes can be compared
    fixed: Mapping[str, float] = field(default_factory=dict)  # parameters, the same in every case

    def place(self, random: np.random.Generator) -> Parameters:
        """Draw what the size leaves open (a direction, a sign, a place), at size 1."""
        return {
            name: value
            for names, draw in self.draws.items()
            for name, value in zip(names.split(), np.atleast_1d(draw(random)).tolist(), strict=True)
        }

    @property
    def strengths(self) -> list[str]:
        """Parameters that grow with the size."""
        growing = (k for k, draw in self.draws.items() if draw in (_size, _signed, _direction))
        return " ".join(growing).split()

    def parameters(self, place: Mapping[str, float], size: float) -> Parameters:
        """Return the parameters of the mechanism at `place` with this size."""
        return {k: v * size if k in self.strengths else v for k, v in place.items()}


_SPOT = {"x0": _between(0.75, 1.15), "y0": _between(-0.5, 0.5)}  # the ends of many casts cross it

LIBRARY: Mapping[str, Mechanism] = {
    "board_tilt": Mechanism({"sx sy": _direction}, 0.01, 0.08),
    "air_drag": Mechanism({"C": _size}, 4.0, 30.0),
    "viscous_friction": Mechanism({"c": _size}, 0.4, 4.0),
    # MuJoCo's cone opposes sliding askew in another direction than the library's law
    "anisotropic_friction": Mechanism({"a": _size}, 0.4, 2.0, same_law=False),
    "friction_patch": Mechanism({"k": _size, **_SPOT, "w": _between(0.15, 0.3)}, 0.5, 3.0),
    "stribeck_friction": Mechanism({"k": _size, "vs": _between(0.2, 0.6)}, 0.4, 2.0),
    # what bends between the heavy end and the light cable carries some of the end's weight
    "endpoint_friction": Mechanism({"k": _size}, 0.3, 2.0, same_law=False),
    "mass_gradient": Mechanism({"k": _signed}, 0.4, 0.85),
    "resting_curvature": Mechanism({"kappa": _signed}, 1.0, 8.0),
    "plastic_bending": Mechanism({"softness": _size}, 0.05, 0.4),
    "tool_lag": Mechanism({"tau": _size}, 0.02, 0.15),
    "wrist_offset": Mechanism({"beta": _signed}, 0.1, 0.6),
    "camera_latency": Mechanism({"tau": _size}, 0.02, 0.2),
    "camera_scale": Mechanism({"k": _signed}, 0.01, 0.1),
    "camera_rotation": Mechanism({"phi": _signed}, 0.01, 0.2),
    "camera_offset": Mechanism({"dx dy": _direction}, 0.01, 0.1),
    "lens_distortion": Mechanism(
        {"x0": _between(0.7, 0.85), "y0": _between(-0.05, 0.05), "k": _signed}, 0.05, 0.3
    ),
    "camera_clock": Mechanism({"k": _signed}, 0.01, 0.1),
    "cable_slip": Mechanism({"s": _size, "v": _between(0.7, 1.1)}, 0.01, 0.04),
    # by as many casts as a set of the benchmark holds
    "friction_drift": Mechanism({"k": _size}, 0.4, 0.8, fixed={"casts": 52}),
    "tool_offset": Mechanism({"dx dy": _direction}, 0.01, 0.05),
}
"""Effects that a diagnosis can name."""

OUTSIDE: Mapping[str, Mechanism] = {
    "rubber_band": Mechanism({"stiffness": _size, **_SPOT}, 0.02, 0.3),
    "sticky_zone": Mechanism({"c": _size, **_SPOT, "radius": _between(0.15, 0.25)}, 2.0, 30.0),
    "draught": Mechanism(
        {
            "a": _size,
            "heading": _between(-np.pi, np.pi),
            "from_y": _between(-0.15, 0.15),
            "side": lambda random: _signed(random),  # does not grow
        },
        0.2,
        2.0,
    ),
    "swinging_end": Mechanism({"share": lambda _: 0.5, "arm": _size}, 0.04, 0.12),
    "warming_board": Mechanism({"k": _size, "time": _between(0.5, 1.0)}, 0.4, 3.0),
}
"""Mechanisms that a diagnosis has no name for."""

MECHANISMS: Mapping[str, Mechanism] = {**LIBRARY, **OUTSIDE}


def make_effect(name: str, given: Mapping[str, float]) -> HiddenEffect:
    """Return the hidden effect `name` with these parameters."""
    return HiddenEffect(name, {**MECHANISMS[name].fixed, **given})


class Shift:
    """How far hidden effects move the paths of some casts on a rig with nothing else hidden.

    A waypoint every `period_s` is looked at.
    """

    def __init__(
        self, rig: VirtualRig, casts: Sequence[PlannedCast], period_s: float, pool: Executor
    ) -> None:
        self._rig, self._casts, self._pool = replace(rig, hidden=()), casts, pool
        longest_s = max(planned.end_s for planned in casts) + SLOWEST_S
        self._stamps = np.arange(round(longest_s / period_s) + 1) * period_s
        self._still_m, self._moves = self._seen({})

    def percent(self, hidden: Mapping[str, Mapping[str, float]]) -> float:
        """Return how far apart the ends are, averaged over a cast, the median over casts.

        In % of cable length. A cast that amplifies everything does not count for more.
        """
        places_m, moving = self._seen(hidden)
        apart = np.linalg.norm(places_m - self._still_m, axis=2)
        averages = np.average(apart, axis=1, weights=moving | self._moves)
        return float(100 * np.median(averages) / self._rig.cable.length_m)

    def sized(
        self, name: str, place: Mapping[str, float], wanted_percent: float
    ) -> tuple[Parameters, float]:
        """Return the parameters with which a mechanism shifts the paths by so much, and by what.

        The shift is below the wanted one where the largest size moves the paths no farther.
        """
        mechanism = MECHANISMS[name]
        size, tried = mechanism.start, []
        for _ in range(TRIALS):
            given = mechanism.parameters(place, size)
            shift = max(self.percent({name: given}), 1e-9)
            miss = abs(np.log(shift / wanted_percent))
            tried.append((miss, given, shift))
            step = float(np.clip(wanted_percent / shift, LEAST_STEP, MOST_STEP))
            following = min(size * step, mechanism.most)
            if miss < np.log1p(NEAR) or following == size:
                break
            size = following
        _, parameters, shift = min(tried, key=lambda one: one[0])
        return parameters, shift

    def _seen(self, hidden: Mapping[str, Mapping[str, float]]) -> tuple[np.ndarray, np.ndarray]:
        """Return ends (n_casts, k, 2) without the camera's noise, and when they move."""
        effects = tuple(make_effect(name, given) for name, given in hidden.items())
        rig, numbers = replace(self._rig, hidden=effects), range(len(self._casts))
        found = list(self._pool.map(_see, repeat(rig), self._casts, numbers, repeat(self._stamps)))
        rests_s = np.array([rest_s for _, rest_s in found])
        return np.stack([places for places, _ in found]), self._stamps <= rests_s[:, None]


def _see(
    rig: VirtualRig, planned: PlannedCast, number: int, stamps: np.ndarray
) -> tuple[np.ndarray, float]:
    cable = rig.simulate_truth(planned, number).cable
    return seen_places(rig, cable, stamps), float(cable.t_s[-1])


def draw_hidden(
    rig: VirtualRig,
    casts: Sequence[PlannedCast],
    pool: Executor,
    seed: int,
    *,
    names: Sequence[str],
    moves_percent: tuple[float, float],
) -> dict[str, Any]:
    """Draw one of the named mechanisms, sized on these casts; return it as `seal` takes it.

    `moves_percent` is the range of how far it moves the paths [% of cable length].
    """
    random = np.random.default_rng(seed)
    name = str(random.choice(list(names)))
    place = MECHANISMS[name].place(random)
    wanted_percent = float(random.uniform(*moves_percent))
    parameters, shift = Shift(rig, casts, PERIOD_S, pool).sized(name, place, wanted_percent)
    return {"effects": [{"effect": name, "parameters": parameters, "shift_percent": shift}]}


def opened(shown: Sequence[HiddenEffect], sealed: str | None) -> tuple[HiddenEffect, ...]:
    """Return the effects that a rig hides: those it is told, and those of a sealed answer."""
    found = unseal(Path(sealed))["effects"] if sealed else ()
    return (*shown, *(make_effect(one["effect"], one["parameters"]) for one in found))


def set_aside(session: Path, rig: VirtualRig) -> Path | None:
    """Move a session that was made with something else hidden out of the way; return where to."""
    path = session / SESSION_FILE
    if not path.is_file() or read_session(session).facts.get("made") == rig.facts()["made"]:
        return None
    places = (session.with_name(f"{session.name}-{n}") for n in count(1))
    place = next(place for place in places if not place.exists())
    session.rename(place)
    return place
