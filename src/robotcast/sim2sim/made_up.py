"""Models with arbitrary parameters, and the casts that they say would be measured."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from robotcast.casts.plan import PlannedCast
from robotcast.measurements.measurement_set import Trial
from robotcast.simulators.simulator import SimulatedCast, Simulator
from robotcast.tuning.objective import full_vectors

DRAWS = 50  # of a model, until one diverges on no cast


@dataclass(frozen=True)
class MadeUp:
    """A model whose parameters are known.

    Attributes
    ----------
    vector : ndarray of shape (n_free,), its free parameters, each mapped to [0, 1].
    tuning, test : its casts to tune to and to judge on.
    """

    vector: np.ndarray
    tuning: tuple[Trial, ...]
    test: tuple[Trial, ...]


@dataclass(frozen=True)
class Filming:
    """When the free end of a made-up cast is seen.

    Attributes
    ----------
    period_s : between waypoints.
    settle_s : after the tool stops, when the last one is seen.
    """

    period_s: float
    settle_s: float


def stream(
    seed: int, number: int, purpose: Literal["model", "casts", "start"], start: int = 0
) -> np.random.Generator:
    """Return random numbers of model `number` that no other purpose shares.

    A search whose start came from the numbers that the model is made of would know the answer.
    """
    tag = {"model": 1, "casts": 2, "start": 3}[purpose]
    return np.random.default_rng([seed, number, tag, start])


def make_up(
    simulator: Simulator,
    casts: Sequence[PlannedCast],
    n_tuning: int,
    filming: Filming,
    *,
    margin: float,
    rng: np.random.Generator,
) -> MadeUp:
    """Draw the free parameters of a simulator and simulate its casts.

    Parameters
    ----------
    casts : those to tune to first, `n_tuning` of them, then those to judge on.
    margin : of every range, kept clear at both ends.

    Raises
    ------
    ValueError
        When every draw diverges on some cast.
    """
    free = [p for p in simulator.parameters if not p.frozen]
    asked = [_filmed(cast, filming) for cast in casts]
    for _ in range(DRAWS):
        vector = rng.uniform(margin, 1 - margin, len(free))
        prediction = simulator.simulate(asked, full_vectors(simulator.parameters, vector))
        if not prediction.diverged.any():
            trials = _trials(casts, asked, prediction.waypoints_m[0])
            return MadeUp(vector, trials[:n_tuning], trials[n_tuning:])
    raise ValueError(f"{DRAWS} draws of the {simulator.name} simulator all diverged on some cast")


def _filmed(cast: PlannedCast, filming: Filming) -> SimulatedCast:
    last_s = cast.end_s + filming.settle_s
    return SimulatedCast(cast.tool, np.arange(0.0, last_s, filming.period_s))


def _trials(
    casts: Sequence[PlannedCast], asked: Sequence[SimulatedCast], waypoints_m: np.ndarray
) -> tuple[Trial, ...]:
    """Return trials with these waypoints (n_casts, k_max, 2), one action each."""
    return tuple(
        Trial(number, number, cast.action, cast.tool, one.waypoints_s, path[: len(one.waypoints_s)])
        for number, (cast, one, path) in enumerate(zip(casts, asked, waypoints_m, strict=True))
    )
