"""What differs from one cast of the virtual rig to the next, all of it drawn from a seed."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class CastNoise:
    """Standard deviations of what changes from cast to cast.

    Attributes
    ----------
    friction : of the board's friction, relative.
    tool_gain : of the arm's excursion, relative.
    tool_delay_s : of the moment the arm starts.
    tool_log_m, tool_log_rad : of one logged tool sample.
    """

    friction: float = 0.015
    tool_gain: float = 0.001
    tool_delay_s: float = 0.002
    tool_log_m: float = 0.0001
    tool_log_rad: float = 0.0005


@dataclass(frozen=True)
class Draw:
    """What chance gave one cast; the start's deviation is left to `StartScatter`."""

    friction_factor: float
    tool_gain: float
    tool_delay_s: float


def generator(seed: int, number: int, purpose: str) -> np.random.Generator:
    """Return a generator that depends on the rig's seed, the cast's number and its use."""
    return np.random.default_rng(np.random.SeedSequence([seed, number, *purpose.encode()]))


def draw(noise: CastNoise, seed: int, number: int) -> Draw:
    """Draw what differs in cast `number`."""
    friction, gain, delay = generator(seed, number, "cast").standard_normal(3)
    return Draw(
        friction_factor=float(np.exp(noise.friction * friction)),
        tool_gain=float(noise.tool_gain * gain),
        tool_delay_s=float(abs(noise.tool_delay_s * delay)),
    )
