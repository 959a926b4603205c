"""The one call that every simulator answers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from robotcast.casts.tool_motion import ToolMotion
from robotcast.fitting.parameter import Parameter
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
