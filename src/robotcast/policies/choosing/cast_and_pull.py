"""The analytic baseline Cast and Pull (paper, "Baseline Policies")."""

import math
from dataclasses import dataclass

import numpy as np

from robotcast.casts.pull import pull_action
from robotcast.measurements.measurement_set import Cable
from robotcast.policies.choosing.choice import Choice


@dataclass(frozen=True)
class CastAndPull:
    """Lays the cable along the ray to the target by a turned reset, then pulls it in slowly.

    Attributes
    ----------
    land_r_m : where the swing of the reset sets the held end down.
    r_min_m : how near to its base the arm may pull the held end; nearer targets are missed.
    pull_m_s : largest speed of the pull.
    angle_rad : largest angle of the ray.
    """

    land_r_m: float
    r_min_m: float
    pull_m_s: float
    angle_rad: float

    def choose(self, cable: Cable, targets_m: np.ndarray) -> list[Choice]:
        """Return the pull for every target (k, 2), as near as the arm can bring the free end."""
        return [self._choice(cable.length_m, target) for target in targets_m]

    def _choice(self, length_m: float, target_m: np.ndarray) -> Choice:
        angle = math.atan2(target_m[1], target_m[0])
        angle = max(-self.angle_rad, min(self.angle_rad, angle))
        wanted = math.hypot(*target_m) - length_m
        held = max(self.r_min_m, min(self.land_r_m, wanted))
        ray = np.array([math.cos(angle), math.sin(angle)])
        action = pull_action(angle, self.land_r_m, held, self.pull_m_s)
        return Choice(target_m, action, (held + length_m) * ray)
