"""What an effect is: one mechanism that a simulator of a cast may lack.

An effect overrides the hooks through which it acts, and no others. Every hook gets the values
of the effect's parameters by name: arrays of shape (n_sim, 1), one row a simulation of the
batch, so that a formula written for one cable holds for all. At its null an effect must change
no bit: add 0, multiply by 1.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from robotcast.effects.motion import CableMotion
from robotcast.fitting.parameter import Parameter

Memory = dict[str, np.ndarray]


class Effect:
    """One effect with its parameters.

    Attributes
    ----------
    name : its id: the name of its file in conf/effect/, in reports and in `diagnosis.json`.
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

    def in_cast(self, factor: np.ndarray, **values: np.ndarray) -> dict[str, np.ndarray]:
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
