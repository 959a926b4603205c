"""What can be hidden, how the cases of the benchmark are drawn from one seed, and their answers.

An effect with a name in the library is drawn with the library's parameters, in their units and
meaning, so that an answer can be compared with a diagnosis number by number. This side knows the
virtual rig's hidden effects and nothing of robotcast.effects and robotcast.diagnosis.
"""

import base64
import binascii
import json
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from robotcast.casts.action import Action
from robotcast.files import write_text
from robotcast.rigs.virtual.mechanisms import HiddenEffect
from robotcast.rigs.virtual.rig import VirtualRig

Parameters = dict[str, float]
Draw = Callable[[np.random.Generator], float | tuple[float, float]]

SESSION = 52  # casts over which friction drifts, as many as the benchmark's sets hold


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

    Attributes
    ----------
    draws : parameter, or two with a space between → how it is drawn for size 1. Those drawn by
        `_size`, `_signed` or `_direction` grow with the size.
    start, most : the size with which its fitting to a wanted shift starts, and the largest.
    same_law : whether an effect of this name in the library follows the same law, so that the
        two sizes can be compared.
    fixed : parameters that are the same in every case.
    """

    draws: Mapping[str, Draw]
    start: float
    most: float
    same_law: bool = True
    fixed: Mapping[str, float] = field(default_factory=dict)

    @property
    def strengths(self) -> list[str]:
        """Parameters that grow with the size."""
        grow = (_size, _signed, _direction)
        return [
            name for names, draw in self.draws.items() if draw in grow for name in names.split()
        ]

    def place(self, random: np.random.Generator) -> Parameters:
        """Draw what the size leaves open (a direction, a sign, a place), at size 1."""
        return {
            name: value
            for names, draw in self.draws.items()
            for name, value in zip(names.split(), np.atleast_1d(draw(random)).tolist(), strict=True)
        }

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
        {"x0": _between(0.7, 0.85), "y0": _between(-0.05, 0.05), "k": _signed},
        0.05,
        0.3,
    ),
    "camera_clock": Mechanism({"k": _signed}, 0.01, 0.1),
    "cable_slip": Mechanism({"s": _size, "v": _between(0.7, 1.1)}, 0.01, 0.04),
    "friction_drift": Mechanism({"k": _size}, 0.4, 0.8, fixed={"casts": SESSION}),
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


@dataclass(frozen=True)
class Case:
    """What a case is made of, before anything is simulated.

    Attributes
    ----------
    name : says nothing about what is hidden.
    kind : nothing hidden, one effect or two of the library, one mechanism outside it.
    cable : which of the rigs it is measured on.
    seed : of its actions and of the rig's chance.
    truth : how many times as large as the cable's own each of these numbers of `CableTruth` is.
    hidden : mechanism → its place (`Mechanism.place`); its size is fitted to `wanted_percent`.
    strength : how the size is called, "" where nothing is hidden.
    wanted_percent : by how far each hidden mechanism shall move the paths, in % of cable length.
    outliers : casts whose tracking went astray.
    noise_s : growth of the tracking noise with speed [m per m/s].
    """

    name: str
    kind: Literal["control", "single", "pair", "outside"]
    cable: str
    seed: int
    truth: Mapping[str, float] = field(default_factory=dict)
    hidden: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    strength: str = ""
    wanted_percent: float = 0.0
    outliers: int = 0
    noise_s: float = 0.0

    def rig(self, nominal: VirtualRig, hidden: Mapping[str, Mapping[str, float]]) -> VirtualRig:
        """Return the rig of this case with `hidden` (mechanism → parameters) at work."""
        factors = {name: getattr(nominal.truth, name) * f for name, f in self.truth.items()}
        return replace(
            nominal,
            truth=replace(nominal.truth, **factors),
            seed=self.seed,
            hidden=tuple(make_effect(name, given) for name, given in hidden.items()),
        )


def draw_cases(composition: Mapping[str, Any], seed: int) -> list[Case]:
    """Draw every case of a composition (full.yaml); their order, and so their names, tell nothing.

    Every effect is hidden at every strength, `draws` times; pairs and what is outside the library
    at the last one. Raises ValueError for an effect that cannot be hidden.
    """
    named = [*composition["effects"], *(name for pair in composition["pairs"] for name in pair)]
    for names, known, what in (
        (named, LIBRARY, "effects"),
        (composition["outside"], OUTSIDE, "outside"),
    ):
        if wrong := [name for name in names if name not in known]:
            raise ValueError(
                f"hidden effects: {wrong[0]} is none of the {what} that can be hidden: "
                f"{', '.join(known)}"
            )
    cases = list(_cases(composition, seed))
    order = np.random.default_rng([seed, 0]).permutation(len(cases))
    return [replace(cases[row], name=f"case-{n:03d}") for n, row in enumerate(order, 1)]


def _cases(composition: Mapping[str, Any], seed: int) -> Iterator[Case]:
    floors, strengths = composition["noise_floor_percent"], composition["strengths"]
    singles = [("single", [e], s) for e in composition["effects"] for s in strengths]
    groups = [("control", control, None) for control in composition["controls"]]
    groups += singles * composition["draws"]
    groups += [("pair", pair, s) for pair in composition["pairs"] for s in strengths[-1:]]
    groups += [("outside", [name], s) for name in composition["outside"] for s in strengths[-1:]]
    for number, (kind, what, strength) in enumerate(groups, 1):
        random = np.random.default_rng([seed, number])
        case = Case("", kind, "", int(random.integers(2**31)))
        if strength is None:
            given = dict(what)
            truth = _varied(composition, random) if given.pop("varied", True) else {}
            yield replace(case, **given, truth=truth)
            continue
        cable = str(random.choice(list(floors)))
        yield replace(
            case,
            cable=cable,
            truth=_varied(composition, random),
            hidden={name: MECHANISMS[name].place(random) for name in what},
            strength=strength["name"],
            wanted_percent=strength["noise_floors"] * floors[cable],
        )


def _varied(composition: Mapping[str, Any], random: np.random.Generator) -> dict[str, float]:
    return {
        name: float(np.exp(spread * random.standard_normal()))
        for name, spread in composition["vary"].items()
    }


def choose_actions(
    feasible: np.ndarray,
    random: np.random.Generator,
    *,
    actions: int,
    repeated: int,
    times: int,
    alike: float = 1.0,
) -> list[tuple[int, Action]]:
    """Draw the casts (action_id, action) of a case from the feasible actions (m, 6).

    Parameters
    ----------
    actions : distinct actions.
    repeated, times : so many of them are cast so many times, to show the noise floor; the
        repeats come last.
    alike : share of the feasible actions that they are drawn from: those nearest to one of them,
        all to one side of the board. 1 draws from all, half of them mirrored.
    """
    if not 0 < alike <= 1:
        raise ValueError(f"hidden effects: expected 0 < alike ≤ 1, got {alike:g}")
    if not 0 <= repeated <= actions or actions < 1 or times < 1:
        raise ValueError(
            "hidden effects: expected 0 ≤ repeated ≤ actions and times ≥ 1, got "
            f"{repeated} of {actions} actions {times} times"
        )
    if alike < 1:
        ranges = np.maximum(np.ptp(feasible, axis=0), 1e-9)
        centre = feasible[random.integers(len(feasible))]
        away = np.linalg.norm((feasible - centre) / ranges, axis=1)
        feasible = feasible[np.argsort(away, kind="stable")[: round(alike * len(feasible))]]
    if actions > len(feasible):
        raise ValueError(f"hidden effects: {actions} actions wanted, {len(feasible)} are feasible")
    rows = random.permutation(len(feasible))[:actions]
    mirrored = (random.permutation(actions) < actions // 2) & (alike == 1)
    drawn = [Action.from_array(feasible[row]) for row in rows]
    drawn = [a.mirrored() if m else a for a, m in zip(drawn, mirrored, strict=True)]
    again = np.repeat(np.arange(repeated), times - 1)
    return [(int(n), drawn[n]) for n in (*range(actions), *again)]


def answer_path(case: str, reports: Path) -> Path:
    """Return where the sealed answer of a case lies."""
    return reports / "answers" / f"{case}.sealed"


def seal(answer: dict[str, Any], path: Path) -> None:
    """Write an answer so that nobody reads it by accident; the same one gives the same bytes."""
    packed = zlib.compress(json.dumps(answer, sort_keys=True).encode(), level=9)
    write_text(path, base64.encodebytes(packed).decode())


def unseal(path: Path) -> dict[str, Any]:
    """Read an answer that `seal` wrote."""
    try:
        return json.loads(zlib.decompress(base64.decodebytes(path.read_bytes())))
    except (binascii.Error, zlib.error, ValueError):
        raise ValueError(f"{path}: is not a sealed answer") from None
