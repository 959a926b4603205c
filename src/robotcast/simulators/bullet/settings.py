"""What is tuned of PyBullet's cable, and its numerical settings."""

from dataclasses import dataclass

PARAMETERS = (
    "twist_stiffness_n_m2",
    "bending_stiffness_n_m2",
    "cable_mass_kg",
    "lateral_friction",
    "spinning_friction_m",
    "rolling_friction_m",
    "endpoint_mass_kg",
    "linear_damping_per_s",
    "angular_damping_per_s",
    "dynamic_friction",
)


@dataclass(frozen=True)
class BulletSettings:
    """Numerical settings, not tuned.

    Attributes
    ----------
    segments : number of capsules.
    step_s : integration step; it is cut for a cable whose springs need it, and runs that diverge
        with it are run again with half of it.
    iterations : of Bullet's constraint solver in every step.
    sliding_speed_m_s : ε of the slip v/√(v² + ε²) that effects on friction see.
    processes : worker processes, 0 for all cores; the result does not depend on it.
    patience_s : a process that takes longer over one cast hangs.
    """

    segments: int = 18
    step_s: float = 0.003
    iterations: int = 50
    sliding_speed_m_s: float = 0.01
    processes: int = 0
    patience_s: float = 600.0
