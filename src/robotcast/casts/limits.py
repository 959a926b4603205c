"""What a planned cast must respect before any arm is asked about it."""

import math
from dataclasses import dataclass, fields


@dataclass(frozen=True)
class PlanLimits:
    """Limits of the planned tool motion.

    Attributes
    ----------
    angular_acceleration_rad_s2, angular_jerk_rad_s3 : of the polar angle θ(t).
    period_s : sample period of the planned motion, 8 ms for a UR5 CB3.
    vmax_m_s : largest v_max that may be asked for.
    angle_rad : largest |θ₁| and |θ₂|.
    alpha_rad : largest |α|.
    r_min_m, r_max_m : radii between which the tool may plan to move.
    """

    angular_acceleration_rad_s2: float = 15.0
    angular_jerk_rad_s3: float = 250.0
    period_s: float = 0.008
    vmax_m_s: float = 2.5
    angle_rad: float = 1.5
    alpha_rad: float = math.pi
    r_min_m: float = 0.5
    r_max_m: float = 0.9

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"plan limits: {field.name} must be positive, got {value}")
        if self.r_min_m >= self.r_max_m:
            raise ValueError(
                f"plan limits: r_min_m must be below r_max_m, got {self.r_min_m}, {self.r_max_m}"
            )
