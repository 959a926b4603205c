"""Fields of a model that differ between the simulations of a batch, or are written into one.

Among them the masses that were fixed to links in some of the logs.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.batch import Batch
from scipy.spatial.transform import Rotation

from robotcast.robots.names import SLIDES, Address, field_of

CONSTANTS = ("body_mass", "body_inertia", "body_ipos", "dof_armature", "actuator_armature")
"""Fields from which MuJoCo derives others: `mj_setConst` follows a change of them."""

Change = Callable[[np.ndarray], np.ndarray]


class ModelFields:
    """Fields as arrays with one row a simulation, wherever they lie.

    `RobotEffect.write` changes them by values of shape (n_sim, 1) or (n_sim, n_rows).
    """

    model: mujoco.MjModel

    def field(self, name: str) -> np.ndarray:
        """Return a field (n_sim, ...), to be written."""
        raise NotImplementedError

    def add(self, at: Address, values: np.ndarray) -> None:
        """Add to the addressed elements."""
        self._change(at, lambda old: old + values)

    def multiply(self, at: Address, values: np.ndarray) -> None:
        """Multiply the addressed elements, and what goes along."""
        for one in (at, *at.along):
            self._change(one, lambda old: old * values)

    def set(self, at: Address, values: np.ndarray) -> None:
        """Overwrite the addressed elements; scale what goes along."""
        if at.along:
            self.multiply(at, values / self.field(at.field)[at.index])
        else:
            self._change(at, lambda old: np.broadcast_to(values, old.shape))

    def _change(self, at: Address, change: Change) -> None:
        field = self.field(at.field)
        field[at.index] = change(field[at.index])


class BatchFields(ModelFields):
    """Fields of a batch, one row a simulation."""

    def __init__(self, batch: Batch) -> None:
        self._batch, self.model = batch, batch.model
        self._constants = False

    def field(self, name: str) -> np.ndarray:
        self._constants |= name in CONSTANTS
        return self._batch.expand(name)

    def finish(self) -> None:
        """Derive what hangs on the fields that were changed."""
        if self._constants:
            self._batch.set_const()


class OneModel(ModelFields):
    """Fields of a single model, as a batch of one; `changed` is what was."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self.model = model
        self.changed: list[Address] = []

    def field(self, name: str) -> np.ndarray:
        return field_of(self.model, name)[None]

    def _change(self, at: Address, change: Change) -> None:
        self.changed.append(at)
        if at.field.startswith("opt.") and at.column is None:  # a number, not a view of it
            old = self.field(at.field)[at.index]
            setattr(self.model.opt, at.field[4:], float(change(old)[0, 0]))
        else:
            super()._change(at, change)


@dataclass(frozen=True)
class Payload:
    """A point mass [kg] on a body, at a place in the body's frame [m]."""

    body: int
    mass_kg: float
    place_m: tuple[float, float, float]


def load(of_sim: Sequence[Sequence[Payload]], fields: ModelFields) -> None:
    """Add every simulation's payloads to the masses of its bodies."""
    mass, ipos = map(fields.field, ("body_mass", "body_ipos"))
    for sim, payloads in enumerate(of_sim):
        for one in payloads:
            b, own = one.body, mass[sim, one.body]
            if fields.model.body_simple[b] == SLIDES:
                mass[sim, b] += one.mass_kg
                continue
            whole, off = own + one.mass_kg, np.array(one.place_m) - ipos[sim, b]
            spread(fields, sim, b, own * one.mass_kg / max(whole, 1e-12), off)
            mass[sim, b] = whole
            ipos[sim, b] += one.mass_kg / max(whole, 1e-12) * off


def spread(fields: ModelFields, sim: int, body: int, reduced_kg: float, off_m: np.ndarray) -> None:
    """Add to a body's inertia that of two masses, of a reduced mass, that are so far apart."""
    inertia, iquat = map(fields.field, ("body_inertia", "body_iquat"))
    turn = Rotation.from_quat(iquat[sim, body], scalar_first=True).as_matrix()
    full = turn * inertia[sim, body] @ turn.T
    full += reduced_kg * (off_m @ off_m * np.eye(3) - np.outer(off_m, off_m))
    moments, turn = np.linalg.eigh(full)
    turn = turn * np.sign(np.linalg.det(turn))
    iquat[sim, body] = Rotation.from_matrix(turn).as_quat(scalar_first=True)
    inertia[sim, body] = moments


def loaded(model: mujoco.MjModel, payloads: Sequence[Payload]) -> mujoco.MjModel:
    """Return the model with these payloads, a copy."""
    model = model.__copy__()
    load([payloads], OneModel(model))
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model
