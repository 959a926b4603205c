"""What an effect of a robot is: one mechanism that its MJCF may lack.

An effect overrides the hooks through which it acts, and no others. Every hook gets the values of
the effect's parameters by name, arrays of shape (n_sim, 1), one row a simulation of the batch. At
its null an effect must change no bit: add 0, multiply by 1.
"""

from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np

from robotcast.fitting.parameter import Parameter
from robotcast.robots.model_fields import ModelFields


@dataclass(frozen=True)
class Where:
    """What one effect acts on: joints, bodies, driven channels or tendons of a part of a robot."""

    name: str  # as it is read, "elbow"; empty for the whole robot
    dofs: tuple[int, ...]
    bodies: tuple[int, ...]
    channels: tuple[int, ...]  # numbers in the order of robot.yaml's `drive`
    actuators: tuple[int, ...]
    tendons: tuple[int, ...] = ()
    each: bool = False  # joints have parameters of their own, one after the other; else all share


@dataclass(frozen=True)
class Motion:
    """A batch of simulations at one instant."""

    slow: Mapping[str, np.ndarray]  # one value a window (see `Log.slow`), (n_sim, 1) each
    log_time_s: np.ndarray  # since the log's start, (n_sim, 1)
    # of the effect's joints, (n_sim, n_dofs) each
    qpos: np.ndarray
    qvel: np.ndarray
    torque: np.ndarray  # what drove them in the step before [N m or N]


class RobotEffect:
    """One effect on one part of the robot.

    Its `name` is its id in reports and `diagnosis.json`, its `text` says in a few words what it is,
    its `parameters` stand in the order of parameter vectors, `part` is what it acts on, as in
    conf/robot_effects.yaml: joint, free motion, sum, difference, tendon, body, drive, robot. A
    flexible field that stands for any mechanism says what it `depends_on`, all others None.
    """

    guess: np.ndarray | None = None  # what a look at the logs promises of its parameters, (n,)

    def __init__(
        self,
        name: str,
        text: str,
        parameters: Sequence[Parameter],
        where: Where,
        *,
        part: str = "joint",
        depends_on: str | None = None,
    ) -> None:
        self.name, self.text, self.where, self.part = name, text, where, part
        self.parameters, self.depends_on = tuple(parameters), depends_on
        if not any(p.null is not None for p in self.parameters):
            raise ValueError(f"effect {name}: one of its parameters needs a null value")

    @property
    def kind(self) -> str:
        """Its name in the library."""
        return self.name.removesuffix(f"_{self.where.name}")

    def of_joints(self, dofs: Sequence[int], name: str = "") -> "RobotEffect":
        """Return an effect of another size in each joint in some of them, called by these."""
        found, where = copy(self), self.where
        kept = [k for k, dof in enumerate(where.dofs) if dof in dofs]
        found.parameters = tuple(self.parameters[k] for k in kept)
        name = name or "_and_".join(p.name.partition("_")[2] for p in found.parameters)
        found.where = replace(where, name=name, dofs=tuple(where.dofs[k] for k in kept))
        found.name = f"{self.kind}_{name}"
        found.text = self.text.replace(where.name.replace("_", " "), name.replace("_", " "))
        found.guess = None if self.guess is None else self.guess[kept]
        return found

    def is_part_of(self, other: "RobotEffect") -> bool:
        """Tell whether another effect does the same to more, or to each joint in a size of its own.

        More are joints, links, drives or tendons.
        """
        own, more = (
            ({*e.dofs}, {*e.bodies}, {*e.channels}, {*e.tendons}) for e in (self.where, other.where)
        )
        within = all(some <= others for some, others in zip(own, more, strict=True))
        fewer = own != more or self.where.each < other.where.each
        return self.kind == other.kind and within and fewer and self.where.each <= other.where.each

    def in_window(self, slow: Mapping[str, np.ndarray], **values: np.ndarray) -> dict[str, Any]:
        """Return what the hooks get in the place of parameters (see `Motion`), (n_sim, 1) each."""
        return values

    def write(self, fields: ModelFields, **values: np.ndarray) -> None:
        """Change fields of the model, before the first step."""

    def closes(self, model: mujoco.MjModel, bias: np.ndarray, **values: np.ndarray) -> None:
        """Change what servos see of the joints whose loops they close, when all else is written.

        That is `bias`, `actuator_biasprm` of every simulation, (n_sim, nu, n), in place.
        """

    def delay_s(self, **values: np.ndarray) -> Any:
        """Return by how much the channels' commands come late, (n_sim, 1)."""

    def pace(self, **values: np.ndarray) -> Any:
        """Return how many seconds of the log pass in one that is simulated, (n_sim, 1)."""

    def command(self, drive: np.ndarray, step_s: float, **values: np.ndarray) -> Any:
        """Return what becomes of the channels' commands (n_sim, n_steps, n_channels)."""

    def force(self, motion: Motion, **values: np.ndarray) -> Any:
        """Return a further torque on the joints, (n_sim, n_dofs)."""

    def friction(self, motion: Motion, **values: np.ndarray) -> Any:
        """Return further dry friction of the joints, (n_sim, n_dofs), solved by MuJoCo."""

    def transmission(self, **values: np.ndarray) -> Any:
        """Return what lies between drives and links (see `Transmission`), (n_sim, 1) each.

        Compliance, retardation time [s], half a gap, and how much teeth may yield at least.
        """

    def latency_s(self, **values: np.ndarray) -> Any:
        """Return by how much the joints' encoders show late, (n_sim, 1)."""

    def seen(self, qpos: np.ndarray, **values: np.ndarray) -> Any:
        """Return what the joints' encoders show of true positions (n_sim, n, n_dofs)."""

    def unseen(self, qpos: np.ndarray, **values: np.ndarray) -> Any:
        """Return the true positions (n_sim, n, n_dofs) where encoders show these."""

    def patch(self, spec: mujoco.MjSpec, model: mujoco.MjModel, **values: float) -> bool:
        """Write into a model what MuJoCo can do of the effect beyond `write`; False if nothing."""
        return False

    def acts_through(self, hook: str) -> bool:
        """Tell whether the effect overrides this hook."""
        return getattr(type(self), hook) is not getattr(RobotEffect, hook)


def effect_of_joints(name: str, effects: Iterable[RobotEffect]) -> RobotEffect | None:
    """Return the effect of this name that is one of others in some of its joints, if any."""
    for one in (e for e in effects if e.where.each):
        joints = name.removeprefix(f"{one.kind}_").split("_and_")
        pairs = zip(one.where.dofs, one.parameters, strict=True)
        dofs = [dof for dof, p in pairs if p.name.partition("_")[2] in joints]
        if len(dofs) > 1 and (found := one.of_joints(dofs)).name == name:
            return found
    return None


Acting = list[tuple[RobotEffect, dict[str, np.ndarray]]]
"""Effects with the values of their parameters by name, (n_sim, 1) each."""
