"""What an effect is: one mechanism that a simulator of a cast may lack.

An effect overrides the hooks through which it acts, and no others. Every hook gets the values
of the effect's parameters by name: arrays of shape (n_sim, 1), one row a simulation of the
batch, so that a formula written for one cable holds for all. At its null an effect must change
no bit: add 0, multiply by 1.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from robotcast.fitting.parameter import Parameter
from robotcast.measurements.measurement_set import Cable

Memory = dict[str, np.ndarray]
Values = dict[str, np.ndarray]
Numbers = Mapping[str, Mapping[str, Any]]  # of parameters by name, as conf/ has them


@dataclass(frozen=True)
class CableMotion:
    """A batch of cables at one instant, as effects see it, whatever simulator moves them.

    Points (n_sim, n_points) run from the hand to the free end: the pieces' centres, the endpoint.
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

    def along_slip(self, size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return vectors of a size (n_sim, n_points) the way that points slide."""
        return size * self.slip_x, size * self.slip_y


class Effect:
    """One effect with its parameters.

    Its `name` is its key in conf/effects.yaml and in reports; `text` says what it is in a few
    words; a flexible field that stands for any mechanism `depends_on` something; `factor` is what
    is known of a cast that `in_cast` asks for.
    """

    factor = ""

    def __init__(
        self, name: str, text: str, parameters: Numbers, depends_on: str | None = None
    ) -> None:
        self.name, self.text, self.depends_on = name, text, depends_on
        self.parameters = tuple(_parameter(own, given) for own, given in parameters.items())
        if not any(p.null is not None for p in self.parameters):
            raise ValueError(f"effect {name}: one of its parameters needs a null value")

    def in_cast(self, factor: np.ndarray, **values: np.ndarray) -> Any:
        """Return what the other hooks get for parameters in casts where `factor` (n_sim, 1) holds.

        It is NaN where it is not known.
        """

    def force(self, cable: CableMotion, **values: np.ndarray) -> Any:
        """Return the x and y forces [N] on every point, each (n_sim, n_points) or broadcast."""

    def mass_factor(self, along: np.ndarray, **values: np.ndarray) -> Any:
        """Return factors of the mass per length; `along` (n_segments,) is −1 to 1 at the end."""

    def rest_curvature(self, cable: CableMotion, **values: np.ndarray) -> Any:
        """Return the curvature [1/m] at which the bending springs rest, (n_sim, n_hinges)."""

    def bending_moment(self, cable: CableMotion, **values: np.ndarray) -> Any:
        """Return a further moment [N m] in every hinge, (n_sim, n_hinges)."""

    def damping_time(self, **values: np.ndarray) -> Any:
        """Return η [s] of a further moment E I η dκ/dt in every hinge (Kelvin–Voigt), (n_sim, 1).

        As a bending moment it would have to be weak: a step that takes damping at its beginning
        diverges where it is strong. Simulators that carry this hook integrate it implicitly.
        """

    def extra_length(self, **values: np.ndarray) -> Any:
        """Return by how much [m] the dragged cable is longer, its mass the same, (n_sim, 1)."""

    def held_pose(
        self, pose: np.ndarray, memory: Memory, step_s: float, **values: np.ndarray
    ) -> Any:
        """Return where the held end is when the log says `pose`, once every step.

        A pose (n_sim, 3) is x and y [m] and yaw [rad], which points along the cable at the hand.
        `memory`, empty at the first step, keeps arrays whose first axis is n_sim.
        """

    def seen(self, points_m: np.ndarray, **values: np.ndarray) -> Any:
        """Return where the camera says that points (n_sim, k, 2) are."""

    def unseen(self, points_m: np.ndarray, **values: np.ndarray) -> Any:
        """Return the points (n_sim, k, 2) that `seen` would put at `points_m`."""

    def seen_at(self, times_s: np.ndarray, **values: np.ndarray) -> Any:
        """Return when that happened which is stamped `times_s` (n_sim, k)."""

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
    return tuple(replace(p, name=f"{e.name}.{p.name}") for e in effects for p in e.parameters)


class ActiveEffects:
    """Runs the hooks of several effects one after another, over a batch of simulations.

    The `values` (n_sim, n) are of all parameters of all effects in order; `factors` are known of
    the cast that each simulation is of, by name.
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
        for effect, *arrays in self._acting:
            values, memory = ({name: a[kept] for name, a in of.items()} for of in arrays)
            fewer._acting.append((effect, values, memory))
        return fewer

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

    def through(self, hook: str, array: np.ndarray) -> np.ndarray:
        """Pass points or times through `seen`, `seen_at` or, the last effect first, `unseen`."""
        acting = list(self.each(hook))
        for change, values, _ in reversed(acting) if hook == "unseen" else acting:
            array = change(array, **values)
        return array
