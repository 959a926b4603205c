"""The one call that every simulator answers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from robotcast.casts.tool_motion import ToolMotion
from robotcast.fitting.parameter import Parameter
from robotcast.measurements.measurement_set import Trial
from robotcast.progress import Progress, silent


@dataclass(frozen=True)
class SimulatedCast:
    """How the tool moves in a cast that was never measured, and when to look, (k,).

    `start_m` (2,) is where the free end was seen before the tool moved, None when it was not:
    then the cable starts along the tool's yaw. `factors` are numbers that are known of the cast,
    by name, for effects that depend on one: "vmax", "order" in the session.
    """

    tool: ToolMotion
    waypoints_s: np.ndarray
    start_m: np.ndarray | None = None
    factors: Mapping[str, float] = field(default_factory=dict)


Cast = SimulatedCast | Trial


@dataclass(frozen=True)
class Prediction:
    """Waypoints (n_vectors, n_casts, k_max, 2) of every cast under every parameter vector.

    NaN past a cast's own k waypoints and wherever the run `diverged`, (n_vectors, n_casts) of bool.
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

        The `vectors` (n_vectors, n_parameters) hold values of all `parameters`, frozen ones too, in
        their order and units. With `retry`, what diverges is run again, more finely; a search
        that compares many vectors can do without, as a few such runs cost it much.
        """
        ...
