"""Effects on the cable, for a batch of chains."""

import numpy as np

from robotcast.effects.active import ActiveEffects
from robotcast.effects.motion import CableMotion
from robotcast.measurements.measurement_set import Cable
from robotcast.simulators.cable_state import CableState
from robotcast.simulators.geometry import ChainGeometry

_HOOKS = ("force", "rest_curvature", "bending_moment")


class CableEffects:
    """Lets the active effects act on chains.

    Attributes
    ----------
    act_here : whether any of them acts while a cable moves.
    """

    def __init__(self, active: ActiveEffects, cable: Cable, geometry: ChainGeometry) -> None:
        self._active = active
        self._cable = cable
        self._geometry = geometry
        self._acting = [hook for hook in _HOOKS if active.has(hook)]
        self.act_here = bool(self._acting)

    def distributed(self, mass_kg: np.ndarray) -> np.ndarray:
        """Return the segments' masses (n_sim, n) as the effects distribute them."""
        lengths = self._geometry.lengths_m
        centre = self._geometry.stub_m + np.cumsum(lengths) - 0.5 * lengths
        along = 2 * centre / self._cable.length_m - 1
        for hook, values, _ in self._active.each("mass_factor"):
            mass_kg = mass_kg * hook(along, **values)
        return mass_kg

    def damping_s(self) -> np.ndarray | float:
        """Return the retardation time [s] that the effects add to bending, (n_sim, 1) or 0."""
        times = (hook(**values) for hook, values, _ in self._active.each("damping_time"))
        return sum(times, start=0.0)

    def extra_m(self) -> np.ndarray | float:
        """Return by how much [m] the effects lengthen the cable, (n_sim, 1) or 0."""
        lengths = (hook(**values) for hook, values, _ in self._active.each("extra_length"))
        return sum(lengths, start=0.0)

    def act(
        self,
        state: CableState,
        *,
        mass_kg: np.ndarray,
        friction_n: np.ndarray,
        bend_rad: np.ndarray,
        bend_rate_rad_s: np.ndarray,
        stiffness_n_m2: np.ndarray,
        time_s: float,
        step_s: float,
    ) -> np.ndarray | None:
        """Add the effects' forces to `state.force_n`; return their moments (n_sim, n), if any."""
        heading = np.concatenate([state.heading, state.heading[:, :, -1:]], axis=2)

        def motion(memory: dict[str, np.ndarray]) -> CableMotion:
            return CableMotion(
                self._cable,
                time_s,
                step_s,
                self._geometry.lengths_m,
                *state.position_m,
                *state.velocity_m_s,
                *state.slip,
                *heading,
                mass_kg=mass_kg,
                friction_n=friction_n,
                bend_rad=bend_rad,
                bend_rate_rad_s=bend_rate_rad_s,
                bends_m=self._geometry.bends_m,
                memory=memory,
            )

        for hook, values, memory in self._active.each("force"):
            x, y = hook(motion(memory), **values)
            np.add(state.force_n[0], x, out=state.force_n[0])
            np.add(state.force_n[1], y, out=state.force_n[1])
        if self._acting == ["force"]:
            return None
        moments = np.zeros(bend_rad.shape)
        for hook, values, memory in self._active.each("rest_curvature"):
            moments += stiffness_n_m2 * hook(motion(memory), **values)
        for hook, values, memory in self._active.each("bending_moment"):
            moments += hook(motion(memory), **values)
        return moments
