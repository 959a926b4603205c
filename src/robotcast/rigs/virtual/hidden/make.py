"""What can be wrong with the cable itself: how its mass lies and how it rests."""

from dataclasses import dataclass

import mujoco
import numpy as np

from robotcast.measurements.measurement_set import Cable
from robotcast.rigs.virtual.cable import CableTruth
from robotcast.rigs.virtual.hidden.effect import Bending, Built


@dataclass(frozen=True)
class UnevenMass(Built):
    """Mass per length is 1 + k s times the mean, s from −1 at the hand to 1 at the end."""

    k: float

    def build(self, spec: mujoco.MjSpec, cable: Cable, truth: CableTruth) -> None:
        for index in range(truth.segments):
            body = spec.body(f"segment_{index}")
            factor = 1 + self.k * (2 * (index + 0.5) / truth.segments - 1)
            body.mass *= factor
            body.inertia = body.inertia * factor


@dataclass(frozen=True)
class CurvedCable(Built):
    """The cable was stored on a drum: at rest it curves by κ, to the left where κ > 0."""

    curvature_1_m: float

    def build(self, spec: mujoco.MjSpec, cable: Cable, truth: CableTruth) -> None:
        length = cable.length_m / truth.segments
        for index in range(truth.segments):
            # the first hinge stands for the half segment between the gripper and its middle
            bent = length * (0.5 if index == 0 else 1.0)
            spec.body(f"segment_{index}").first_joint().springref = self.curvature_1_m * bent


@dataclass(frozen=True)
class SoftCore(Bending):
    """Bent beyond the yield curvature the cable keeps what is beyond, as a soft wire does."""

    yield_1_m: float

    def rest_rad(self, bend_rad: np.ndarray, rest_rad: np.ndarray, length_m: float) -> np.ndarray:
        lengths = np.full(len(bend_rad), length_m)
        lengths[0] *= 0.5
        most = self.yield_1_m * lengths
        return np.clip(rest_rad, bend_rad - most, bend_rad + most)
