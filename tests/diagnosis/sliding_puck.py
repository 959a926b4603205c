"""A puck that is pushed over a board and slows down: a model that costs nothing to run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from robotcast.diagnosis.misfit import padded
from robotcast.diagnosis.model import Axis, Record, Wording
from robotcast.fitting.parameter import Parameter

WORDS = Wording(
    trial="push",
    trials="pushes",
    sample="position",
    samples="positions",
    mover="the puck",
    axes=(Axis("x", "m"), Axis("y", "m")),
    factor_units={"speed": "m/s", "heading": "rad"},
)
TIMES_S = np.arange(16) * 0.15
NOISE_M = 0.004
DRAG_PER_S, GAIN = 1.1, 0.95


def strength(name: str, unit: str, most: float, probe: float) -> Parameter:
    return Parameter(name, unit, -most, most, nominal=0.0, null=0.0, probes=(-probe, probe))


@dataclass(frozen=True)
class Mechanism:
    """A candidate of the puck; what it does stands in `Puck`."""

    name: str
    text: str
    parameters: tuple[Parameter, ...]
    depends_on: str | None = None


TILT = Mechanism(
    "tilt",
    "the board is not level",
    (strength("ax", "m/s²", 1.0, 0.03), strength("ay", "m/s²", 1.0, 0.03)),
)
LATE = Mechanism("late_clock", "the clock is late", (strength("tau", "s", 0.3, 0.02),))
SHIFT = Mechanism(
    "shift",
    "the camera is shifted",
    (strength("dx", "m", 0.3, 0.01), strength("dy", "m", 0.3, 0.01)),
)
TURN = Mechanism("turn", "the camera is turned", (strength("phi", "rad", 0.3, 0.01),))
SHEAR = Mechanism("shear", "the camera shears its picture", (strength("k", "1", 0.3, 0.01),))
DEAD = Mechanism("dead", "something the model does not know", (strength("k", "1", 1.0, 0.1),))
FAINT = Mechanism("faint", "something far too small", (strength("k", "1", 1.0, 0.1),))
NULLED = Mechanism("nulled", "something that is held", (strength("k", "1", 1.0, 0.0),))


class Puck:
    """x(t) = x₀ + d g v (1 − e^(−c t)) / c along the heading d; a `Model`.

    Parameters
    ----------
    ignored : adds a parameter of the base model that changes nothing.
    """

    scale, error_unit = 1.0, "% of a metre"

    def __init__(self, *effects: Mechanism, ignored: bool = False) -> None:
        self.effects = {effect.name: effect for effect in effects}
        self.parameters = (
            Parameter("drag", "1/s", 0.3, 3.0, 1.0, scale="log"),
            Parameter("gain", "1", 0.7, 1.3, 1.0),
            *([Parameter("board_colour", "1", 0.0, 1.0, 0.5)] if ignored else []),
        )

    def predict(
        self, records: Sequence[Record], active: Sequence[str], vectors: np.ndarray
    ) -> np.ndarray:
        own, at = {}, len(self.parameters)
        for name in active:
            n = len(self.effects[name].parameters)
            own[name], at = vectors[:, at : at + n], at + n
        return _paths(records, vectors[:, 0], vectors[:, 1], own)


def _paths(
    records: Sequence[Record], drag: np.ndarray, gain: np.ndarray, own: Mapping[str, np.ndarray]
) -> np.ndarray:
    """Return paths (n_vectors, n_records, k, 2); `own` holds values (n_vectors, n) by effect."""

    def values(name: str, n: int) -> np.ndarray:
        given = own.get(name, np.zeros((len(drag), n)))
        return given[:, None, None, :]  # beside (n_vectors, n_records, k)

    speed, heading = (np.array([r.factors[f] for r in records]) for f in ("speed", "heading"))
    way = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    late = values("late_clock", 1)[..., 0]
    t = np.maximum(padded(records, [r.times_s for r in records]) - late, 0.0)
    c = drag[:, None, None]
    grown = (1 - np.exp(-c * t)) / c
    path = (gain[:, None, None] * speed[:, None] * grown)[..., None] * way[:, None, :]
    path = path + values("tilt", 2) * ((t - grown) / c)[..., None]
    path = path * (1 + 1e-7 * values("faint", 1))
    x, y, phi = path[..., 0], path[..., 1], values("turn", 1)[..., 0]
    x, y = x * np.cos(phi) - y * np.sin(phi), x * np.sin(phi) + y * np.cos(phi)
    y = y + values("shear", 1)[..., 0] * x
    return np.stack([x, y], axis=-1) + values("shift", 2)


def pushes(
    seed: int = 0,
    groups: int = 20,
    repeats: int = 2,
    heading: tuple[float, float] = (-1.5, 1.5),
    **hidden: Sequence[float],
) -> tuple[Record, ...]:
    """Return measured pushes of a puck with `hidden` effects (name → values of parameters)."""
    rng = np.random.default_rng(seed)
    factors = [
        {"speed": rng.uniform(0.4, 1.2), "heading": rng.uniform(*heading)} for _ in range(groups)
    ]
    return pushed([f for f in factors for _ in range(repeats)], seed, **hidden)


def pushed(
    factors: Sequence[Mapping[str, float]], seed: int = 0, **hidden: Sequence[float]
) -> tuple[Record, ...]:
    """Return measured pushes with these factors; equal ones are repeats."""
    rng = np.random.default_rng(seed)
    own = {name: np.array([values], dtype=float) for name, values in hidden.items()}
    groups: list[Mapping[str, float]] = []
    records: list[Record] = []
    for some in factors:
        groups += [] if some in groups else [some]
        number, group = len(records), groups.index(some)
        bare = Record(number, group, TIMES_S, TIMES_S[:, None], some)
        path = _paths([bare], np.array([DRAG_PER_S]), np.array([GAIN]), own)[0, 0]
        noise = NOISE_M * rng.normal(size=(1, 2)) + NOISE_M / 2 * rng.normal(size=path.shape)
        records.append(Record(number, group, TIMES_S, path + noise, some))
    return tuple(records)
