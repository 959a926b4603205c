"""The one call that every simulator answers, and simulators made from config numbers."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from robotcast.casts.tool_motion import ToolMotion
from robotcast.effects.effect import Effect
from robotcast.fitting.parameter import Parameter
from robotcast.measurements.measurement_set import Cable
from robotcast.progress import Progress, silent


class Cast(Protocol):
    """What a simulator needs of a cast: its start, how the tool moved, and when to look.

    `start_m` (2,) is where the free end was seen before the tool moved, None when it was not:
    then the cable starts along the tool's yaw. `factors` are numbers that are known of the cast,
    by name, for effects that depend on one: "vmax", "order" in the session.
    """

    @property
    def tool(self) -> ToolMotion: ...

    @property
    def waypoints_s(self) -> np.ndarray: ...

    @property
    def start_m(self) -> np.ndarray | None: ...

    @property
    def factors(self) -> Mapping[str, float]: ...


@dataclass(frozen=True)
class SimulatedCast:
    """A cast that was never measured."""

    tool: ToolMotion
    waypoints_s: np.ndarray
    start_m: np.ndarray | None = None
    factors: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Prediction:
    """Waypoints of every cast under every parameter vector.

    Attributes
    ----------
    waypoints_m : ndarray of shape (n_vectors, n_casts, k_max, 2); NaN past a cast's own k
        waypoints and wherever the run diverged.
    diverged : bool ndarray of shape (n_vectors, n_casts).
    """

    waypoints_m: np.ndarray
    diverged: np.ndarray


class Simulator(Protocol):
    """Predicts the free end's waypoints for casts × parameter vectors in one call."""

    @property
    def name(self) -> str: ...

    @property
    def parameters(self) -> tuple[Parameter, ...]: ...

    def simulate(
        self,
        casts: Sequence[Cast],
        vectors: np.ndarray,
        *,
        retry: bool = True,
        progress: Progress = silent,
    ) -> Prediction:
        """Simulate every cast under every parameter vector.

        Parameters
        ----------
        casts : the tool motions and the times of the wanted waypoints.
        vectors : ndarray of shape (n_vectors, n_parameters), values of all `parameters`
            (frozen ones too) in their order and units.
        retry : run again, more finely, what diverges. A search that compares many vectors can do
            without; a few such runs cost it much.
        """
        ...


WEIGHTLESS_KG = 1e-5  # a body without mass would stand still in PyBullet


def make_simulator(
    kind: Callable[[Cable, Sequence[Parameter], Any, Sequence[Effect]], Simulator],
    cable: Cable,
    parameters: Mapping[str, Mapping[str, Any]],
    settings: Any,
    effects: Sequence[Effect] = (),
) -> Simulator:
    """Make a simulator of `cable`, with these effects, from config numbers.

    Parameters
    ----------
    kind : its class.
    parameters : name → numbers, either `lower`, `upper` and `nominal`, or `weighed` and `spread`:
        the cable's attribute that is its nominal value, searched from nominal / spread to
        nominal · spread; one that is zero is held at next to nothing.
    settings : of this kind, whatever they are.
    """
    made = [_parameter(name, dict(numbers), cable) for name, numbers in parameters.items()]
    return kind(cable, made, settings, effects)


def _parameter(name: str, numbers: dict[str, Any], cable: Cable) -> Parameter:
    if "weighed" in numbers:
        nominal, spread = float(getattr(cable, numbers.pop("weighed"))), numbers.pop("spread")
        if nominal == 0:  # as of a cable without a weight at its end: there is nothing to search
            nominal, numbers["frozen"] = WEIGHTLESS_KG, True
        numbers |= {"lower": nominal / spread, "upper": nominal * spread, "nominal": nominal}
    return Parameter(name=name, **numbers)
