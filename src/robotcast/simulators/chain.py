"""A cable cut into a planar chain of rigid segments, and a batch of such chains under way.

The chain lies in the board's plane. Its generalised coordinates are the held end's x, y and
yaw, then one hinge angle per segment, followed by a stretch where the segment stretches.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

from robotcast.effects.effect import ActiveEffects, CableMotion
from robotcast.measurements.measurement_set import Cable

TOOL_DOFS = 3
GRAVITY_M_S2 = 9.81


@dataclass(frozen=True)
class ChainGeometry:
    """How a cable is cut into segments and hinges.

    A hinge stands for the bending of the cable around it, and sits in the middle of what it
    stands for: between segments one length l, at the gripper the first l/2, so that the first
    hinge sits at l/4, at the end of a stub that is part of the gripper. Some segments slide along
    themselves for the stretching of the cable nearest to them: a few are enough, because a cable
    stretches as a whole long before its parts do on their own.
    """

    stub_m: float  # from the held end to the first hinge
    lengths_m: np.ndarray  # (n,), from each hinge to the next, the last to the free end
    bends_m: np.ndarray  # (n,), the length of cable whose bending each hinge carries
    stretching: np.ndarray  # bool (n,), which segments stretch

    @classmethod
    def of_cable(cls, length_m: float, segments: int, stretches: int = 0) -> "ChainGeometry":
        """Cut a cable into equal segments but for the first; some stretch, evenly spread."""
        full = length_m / segments
        lengths, bends = np.full(segments, full), np.full(segments, full)
        lengths[0] -= 0.25 * full
        bends[0] = 0.5 * full
        stretching = np.zeros(segments, dtype=bool)
        stretching[[(2 * part + 1) * segments // (2 * stretches) for part in range(stretches)]] = 1
        return cls(0.25 * full, lengths, bends, stretching)

    @cached_property
    def hinges(self) -> np.ndarray:
        """Which generalised coordinates are the hinges' angles, int (n,)."""
        before = np.cumsum(self.stretching) - self.stretching
        return TOOL_DOFS + np.arange(len(self.lengths_m)) + before

    @cached_property
    def slides(self) -> np.ndarray:
        """Which generalised coordinates are the segments' stretches, int (n,); −1 for none."""
        return np.where(self.stretching, self.hinges + 1, -1)

    @cached_property
    def stretches_m(self) -> np.ndarray:
        """The length of cable whose stretching each slide carries; they add up to the cable."""
        hinge_m = self.stub_m + np.cumsum(self.lengths_m) - self.lengths_m
        at_m, end_m = hinge_m[self.stretching], self.stub_m + self.lengths_m.sum()
        bounds_m = np.concatenate([[0.0], 0.5 * (at_m[1:] + at_m[:-1]), [end_m]])
        return np.diff(bounds_m[: len(at_m) + 1])


def capsule_inertia(mass_kg: np.ndarray, length_m: np.ndarray, radius_m: float) -> np.ndarray:
    """Return the inertia [kg m²] of a solid rod about its centre, across its axis."""
    return mass_kg * (length_m**2 / 12 + radius_m**2 / 4)


@dataclass(frozen=True)
class CableState:
    """Where the cables' mass points are and how they move, for a batch of simulations.

    The n + 1 points are the segments' centres from hand to end, then the endpoint. Arrays are
    float32, their first axis x and y.
    """

    heading: np.ndarray  # (2, n_sim, n), unit vector along each segment
    position_m: np.ndarray  # (2, n_sim, n + 1)
    velocity_m_s: np.ndarray
    slip: np.ndarray  # v / √(v² + ε²): the way each point slides
    force_n: np.ndarray  # what is to be applied to the points


class Run(ABC):
    """A batch of cables under way, straight and at rest at first, with the effects on them.

    The tools have poses (n_sim, 3), the cables angles from their yaws (n_sim,), and the simulator
    parameters of its own (n_sim, n). Of the effects it applies what acts on the cable.
    """

    _points_kg: np.ndarray  # float32 (n_sim, n + 1), and their μ m g, which a kind of run sets
    _friction_n: np.ndarray

    def __init__(
        self,
        cable: Cable,
        settings: Any,
        step_s: float,
        pose: np.ndarray,
        lean_rad: np.ndarray,
        vectors: np.ndarray,
        active: ActiveEffects,
    ) -> None:
        self._cable, self._settings, self._step_s, self._time_s = cable, settings, step_s, 0.0
        self._vectors, self._active = vectors, active
        cut = settings.segments, settings.stretches
        self._geometry = ChainGeometry.of_cable(cable.length_m, *cut)
        self._lay(pose, lean_rad)

    @abstractmethod
    def _lay(self, pose: np.ndarray, lean_rad: np.ndarray) -> None:
        """Lay the cables straight and at rest."""

    @abstractmethod
    def state(self) -> CableState:
        """Return the mass points of the simulations."""

    @abstractmethod
    def fastest_rate(self) -> np.ndarray:
        """Return the largest generalised speed of each simulation, (n_sim,)."""

    @abstractmethod
    def step(self, state: CableState, next_pose: np.ndarray) -> None:
        """Advance one step; the tool reaches `next_pose` (n_sim, 3) at its end."""

    @abstractmethod
    def keep(self, kept: np.ndarray, active: ActiveEffects) -> None:
        """Go on with the simulations numbered `kept` only, in this order."""

    @abstractmethod
    def _bends(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the hinges' angles [rad] and rates [rad/s], (n_sim, n)."""

    def _distributed(self, mass_kg: np.ndarray) -> np.ndarray:
        """Return the segments' masses (n_sim, n) as the effects distribute them."""
        lengths = self._geometry.lengths_m
        centre = self._geometry.stub_m + np.cumsum(lengths) - 0.5 * lengths
        along = 2 * centre / self._cable.length_m - 1
        for hook, values, _ in self._active.each("mass_factor"):
            mass_kg = mass_kg * hook(along, **values)
        return mass_kg

    def _act(self, state: CableState, stiffness_n_m2: np.ndarray) -> np.ndarray | None:
        """Add the effects' forces to `state.force_n`; return their moments (n_sim, n), if any.

        A resting curvature acts through the stiffness E I of the hinges.
        """
        hooks = "force", "rest_curvature", "bending_moment"
        pushing, resting, bending = (list(self._active.each(hook)) for hook in hooks)
        if not (pushing or resting or bending):
            return None
        bends = self._bends()
        heading = np.concatenate([state.heading, state.heading[:, :, -1:]], axis=2)
        points = (*state.position_m, *state.velocity_m_s, *state.slip, *heading)
        points = (*points, self._points_kg, self._friction_n, *bends, self._geometry.bends_m)
        when = self._time_s, self._step_s
        motion = partial(CableMotion, self._cable, *when, self._geometry.lengths_m, *points)
        for force, values, memory in pushing:
            x, y = force(motion(memory=memory), **values)
            np.add(state.force_n[0], x, out=state.force_n[0])
            np.add(state.force_n[1], y, out=state.force_n[1])
        if not (resting or bending):
            return None
        moments = np.zeros(bends[0].shape)
        for curvature, values, memory in resting:
            moments += stiffness_n_m2 * curvature(motion(memory=memory), **values)
        for moment, values, memory in bending:
            moments += moment(motion(memory=memory), **values)
        return moments
