"""What goes to the worker processes of the PyBullet simulator."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robotcast.effects.effect import Effect
from robotcast.measurements.measurement_set import Cable
from robotcast.simulators.bullet.settings import BulletSettings
from robotcast.simulators.simulator import SimulatedCast


@dataclass(frozen=True)
class Setup:
    """What all casts of a simulator share."""

    cable: Cable
    settings: BulletSettings
    effects: Sequence[Effect]


@dataclass(frozen=True)
class Task:
    """One cast under one vector (n_parameters,); `retry` as in `Simulator.simulate`."""

    cast: SimulatedCast
    vector: np.ndarray
    retry: bool
