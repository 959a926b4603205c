"""Masses that were fixed to a robot's links in some of its logs."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np


@dataclass(frozen=True)
class Payload:
    """A point mass [kg] on a body, at a place in the body's frame [m]."""

    body: int
    mass_kg: float
    place_m: tuple[float, float, float]


def load(
    of_sim: Sequence[Sequence[Payload]],
    mass: np.ndarray,
    ipos: np.ndarray,
    inertia: np.ndarray,
    iquat: np.ndarray,
) -> None:
    """Add every simulation's payloads to its `body_mass` (n_sim, n_body) and the like, in place."""
    for sim, payloads in enumerate(of_sim):
        for one in payloads:
            b, own = one.body, mass[sim, one.body]
            axes = np.empty(9)
            mujoco.mju_quat2Mat(axes, iquat[sim, b])
            turn = axes.reshape(3, 3)
            whole, off = own + one.mass_kg, np.array(one.place_m) - ipos[sim, b]
            reduced = own * one.mass_kg / max(whole, 1e-12)
            full = turn * inertia[sim, b] @ turn.T
            full += reduced * (off @ off * np.eye(3) - np.outer(off, off))
            moments, turn = np.linalg.eigh(full)
            turn = turn * np.sign(np.linalg.det(turn))
            mujoco.mju_mat2Quat(iquat[sim, b], turn.ravel())
            inertia[sim, b], mass[sim, b] = moments, whole
            ipos[sim, b] += one.mass_kg / max(whole, 1e-12) * off


def loaded(model: mujoco.MjModel, payloads: Sequence[Payload]) -> mujoco.MjModel:
    """Return the model with these payloads, a copy."""
    model = model.__copy__()
    load(
        [payloads],
        model.body_mass[None],
        model.body_ipos[None],
        model.body_inertia[None],
        model.body_iquat[None],
    )
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model
