"""What an effect is: one mechanism that a simulator of a cast may lack.

An effect overrides the hooks through which it acts, and no others. Every hook gets the values
of the effect's parameters by name: arrays of shape (n_sim, 1), one row a simulation of the
batch, so that a formula written for one cable holds for all. At its null an effect must change
no bit: add 0, multiply by 1.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from robotcast.fitting.parameter import Parameter
from robotcast.measurements.measurement_set import Cable

Memory = dict[str, np.ndarray]
Values = dict[str, np.ndarray]


@dataclass(frozen=True)
class CableMotion:
    """A batch of cables at one instant, as effects see it, whatever simulator moves them.

    Points run from the hand to the free end: one for every piece of cable, at its centre, then
    the endpoint. Arrays of them are (n_sim, n_points).
    """

    cable: Cable  # what its owner measured of it
    time_s: float  # since the start of the cast
    step_s: float  # until the next instant
    lengths_m: np.ndarray  # (n_points − 1,) of the pieces
    x: np.ndarray  # position [m]
    y: np.ndarray
    vx: np.ndarray  # velocity [m/s]
    vy: np.ndarray
    slip_x: np.ndarray  # the way a point slides, v / √(v² + ε²): a unit vector but near rest
    slip_y: np.ndarray
    tx: np.ndarray  # unit vector along the cable; of the endpoint, along the last piece
    ty: np.ndarray
    mass_kg: np.ndarray
    friction_n: np.ndarray  # μ m g
    bend_rad: np.ndarray  # (n_sim, n_hinges), positive to the left
    bend_rate_rad_s: np.ndarray
    bends_m: np.ndarray  # (n_hinges,), the length of cable whose bending a hinge carries
    memory: Memory  # what an effect wants to find again at the next step; arrays with n_sim rows

    @property
    def curvature(self) -> np.ndarray:
        """Curvature at the hinges, (n_sim, n_hinges) [1/m]."""
        return self.bend_rad / self.bends_m

    @property
    def bending_rate(self) -> np.ndarray:
        """How fast the curvature changes, (n_sim, n_hinges) [1/(m s)]."""
        return self.bend_rate_rad_s / self.bends_m

    def on_endpoint(self, values: np.ndarray) -> np.ndarray:
        """Return values (n_sim, 1) at the endpoint and 0 at every other point."""
        spread = np.zeros_like(self.mass_kg)
        spread[:, -1:] = values
        return spread


class Effect:
    """One effect with its parameters.

    Attributes
    ----------
    name : its id: its key in conf/effects.yaml, in reports and in `diagnosis.json`.
    text : what it is, in a few words.
    parameters : in the order in which they stand in parameter vectors.
    depends_on : None, or of a flexible field that stands for any mechanism, what it depends on.
    factor : what is known of a cast that `in_cast` asks for.
    """

    factor = ""

    def __init__(
        self,
        name: str,
        text: str,
        parameters: Mapping[str, Mapping[str, Any]],
        depends_on: str | None = None,
    ) -> None:
        self.name = name
        self.text = text
        self.parameters = tuple(_parameter(own, given) for own, given in parameters.items())
        self.depends_on = depends_on
        if not any(p.null is not None for p in self.parameters):
            raise ValueError(f"effect {name}: one of its parameters needs a null value")

    def in_cast(self, factor: np.ndarray, **values: np.ndarray) -> Values:
        """Return the values with which the effect acts in casts where `factor` (n_sim, 1) holds.

        The other hooks get them in place of the parameters. NaN where the factor is not known.
        """
        raise NotImplementedError

    def force(self, cable: CableMotion, **values: np.ndarray) -> tuple[Any, Any]:
        """Return the x and y forces [N] on every point, each (n_sim, n_points) or broadcast."""
        raise NotImplementedError

    def mass_factor(self, along: np.ndarray, **values: np.ndarray) -> np.ndarray:
        """Return what the cable's mass per length is multiplied by, (n_sim, n_segments).

        `along` (n_segments,) is −1 at the hand and 1 at the free end.
        """
        raise NotImplementedError

    def rest_curvature(self, cable: CableMotion, **values: np.ndarray) -> np.ndarray:
        """Return the curvature [1/m] at which the bending springs rest, (n_sim, n_hinges)."""
        raise NotImplementedError

    def bending_moment(self, cable: CableMotion, **values: np.ndarray) -> np.ndarray:
        """Return a further moment [N m] in every hinge, (n_sim, n_hinges)."""
        raise NotImplementedError

    def damping_time(self, **values: np.ndarray) -> np.ndarray:
        """Return η [s] of a further moment E I η dκ/dt in every hinge, (n_sim, 1).

        The retardation time of a Kelvin–Voigt material. As a bending moment it would have to be
        weak: a step that takes damping at its beginning diverges where it is strong. Simulators
        that carry this hook integrate it implicitly.
        """
        raise NotImplementedError

    def extra_length(self, **values: np.ndarray) -> np.ndarray:
        """Return by how much [m] the cable that is dragged is longer, (n_sim, 1).

        Its mass stays what it is; simulators whose cable does not stretch cannot carry it.
        """
        raise NotImplementedError

    def held_pose(
        self, pose: np.ndarray, memory: Memory, step_s: float, **values: np.ndarray
    ) -> np.ndarray:
        """Return where the held end is when the log says `pose` (n_sim, 3), once every step.

        `memory` is empty at the first step and keeps arrays whose first axis is n_sim.
        """
        raise NotImplementedError

    def seen(self, points_m: np.ndarray, **values: np.ndarray) -> np.ndarray:
        """Return where the camera says that points (n_sim, k, 2) are."""
        raise NotImplementedError

    def unseen(self, points_m: np.ndarray, **values: np.ndarray) -> np.ndarray:
        """Return the points (n_sim, k, 2) that `seen` would put at `points_m`."""
        raise NotImplementedError

    def seen_at(self, times_s: np.ndarray, **values: np.ndarray) -> np.ndarray:
        """Return when that happened which is stamped `times_s` (n_sim, k)."""
        raise NotImplementedError

    def acts_through(self, hook: str) -> bool:
        """Tell whether this effect overrides the hook."""
        return getattr(type(self), hook) is not getattr(Effect, hook)


def _parameter(name: str, numbers: Mapping[str, Any]) -> Parameter:
    """Make a parameter from config numbers, whose null stands as `null_at`.

    A strength starts at its null, any other parameter at its nominal or the first place to try.
    """
    given = dict(numbers)
    null, probes = given.pop("null_at", None), tuple(given.pop("probes", ()))
    nominal = given.pop("nominal", null if null is not None else (*probes, None)[0])
    if nominal is None:
        raise ValueError(f"effect parameter {name}: null_at, nominal or probes must be given")
    return Parameter(name=name, nominal=nominal, null=null, probes=probes, **given)


def parameters_of(effects: Sequence[Effect]) -> tuple[Parameter, ...]:
    """Return the parameters of all effects, named effect.parameter."""
    return tuple(
        p.named(f"{effect.name}.{p.name}") for effect in effects for p in effect.parameters
    )


class ActiveEffects:
    """Runs the hooks of several effects one after another, over a batch of simulations.

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
        self._acting: list[tuple[Effect, Values, Memory]] = []
        columns = iter(values.T)
        for effect in effects:
            own = {p.name: next(columns)[:, None] for p in effect.parameters}
            if effect.acts_through("in_cast"):
                factor = [one.get(effect.factor, np.nan) for one in factors]
                own = effect.in_cast(np.array(factor)[:, None], **own)
            # double precision where few numbers pass through, single where whole cables do
            dtype = np.float32 if effect.acts_through("force") else np.float64
            typed = {name: np.ascontiguousarray(v, dtype=dtype) for name, v in own.items()}
            self._acting.append((effect, typed, {}))

    def keep(self, kept: np.ndarray) -> "ActiveEffects":
        """Return the same for the simulations numbered `kept` only, in this order."""
        fewer = ActiveEffects((), np.empty((0, 0)))

        def rows(arrays: Values) -> Values:
            return {name: array[kept] for name, array in arrays.items()}

        fewer._acting = [(effect, rows(values), rows(m)) for effect, values, m in self._acting]
        return fewer

    def has(self, hook: str) -> bool:
        """Tell whether any effect acts through the hook."""
        return any(effect.acts_through(hook) for effect, *_ in self._acting)

    def each(self, hook: str) -> Iterator[tuple[Callable[..., Any], Values, Memory]]:
        """Yield the hook, the values and the memory of every effect that acts through it."""
        for effect, values, memory in self._acting:
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
