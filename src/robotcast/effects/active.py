"""The effects that act in a batch of simulations, with the values they act with."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from robotcast.effects.effect import Effect, Memory
from robotcast.fitting.parameter import Parameter

Values = dict[str, np.ndarray]


def parameters_of(effects: Sequence[Effect]) -> tuple[Parameter, ...]:
    """Return the parameters of all effects, named effect.parameter."""
    return tuple(
        p.named(f"{effect.name}.{p.name}") for effect in effects for p in effect.parameters
    )


class ActiveEffects:
    """Runs the hooks of several effects one after another.

    Parameters
    ----------
    values : ndarray of shape (n_sim, n), of all parameters of all effects in order.
    factors : what is known of the cast that each simulation is of, by name.
    """

    def __init__(
        self,
        effects: Sequence[Effect],
        values: np.ndarray,
        factors: Sequence[Mapping[str, float]] = (),
    ) -> None:
        self._effects = tuple(effects)
        self._values = values
        self._factors = factors
        self._memories: list[Memory] = [{} for _ in effects]
        self._split = self._by_effect()

    def keep(self, kept: np.ndarray) -> "ActiveEffects":
        """Return the same for the simulations numbered `kept` only, in this order."""
        factors = [self._factors[k] for k in kept] if self._factors else ()
        fewer = ActiveEffects(self._effects, self._values[kept], factors)
        fewer._memories = [
            {name: array[kept] for name, array in memory.items()} for memory in self._memories
        ]
        return fewer

    def has(self, hook: str) -> bool:
        """Tell whether any effect acts through the hook."""
        return any(effect.acts_through(hook) for effect in self._effects)

    def each(self, hook: str) -> Iterator[tuple[Callable[..., Any], Values, Memory]]:
        """Yield the hook, the values and the memory of every effect that acts through it."""
        for effect, values, memory in zip(self._effects, self._split, self._memories, strict=True):
            if effect.acts_through(hook):
                yield getattr(effect, hook), values, memory

    def held_pose(self, pose: np.ndarray, step_s: float) -> np.ndarray:
        """Return the held end's poses when the log says `pose` (n_sim, 3)."""
        for hook, values, memory in self.each("held_pose"):
            pose = hook(pose, memory, step_s, **values)
        return pose

    def seen(self, points_m: np.ndarray) -> np.ndarray:
        """Return where the camera says that points (n_sim, k, 2) are."""
        for hook, values, _ in self.each("seen"):
            points_m = hook(points_m, **values)
        return points_m

    def unseen(self, points_m: np.ndarray) -> np.ndarray:
        """Return what the camera would put at `points_m` (n_sim, k, 2)."""
        for hook, values, _ in reversed(list(self.each("unseen"))):
            points_m = hook(points_m, **values)
        return points_m

    def seen_at(self, times_s: np.ndarray) -> np.ndarray:
        """Return when that happened which is stamped `times_s` (n_sim, k)."""
        for hook, values, _ in self.each("seen_at"):
            times_s = hook(times_s, **values)
        return times_s

    def _by_effect(self) -> list[Values]:
        # double precision where few numbers pass through, single where whole cables do
        columns = iter(self._values.T)
        split = []
        for effect in self._effects:
            dtype = np.float32 if effect.acts_through("force") else np.float64
            own = {p.name: next(columns)[:, None] for p in effect.parameters}
            if effect.acts_through("in_cast"):
                factor = [one.get(effect.factor, np.nan) for one in self._factors]
                own = effect.in_cast(np.array(factor)[:, None], **own)
            split.append({n: np.ascontiguousarray(v, dtype=dtype) for n, v in own.items()})
        return split
