"""The six numbers of a cast (paper, "Parameterized Actions"), and the motion of its held end."""

import math
from dataclasses import dataclass

import numpy as np

ACTION_COLUMNS = ("theta1", "r1", "theta2", "r2", "alpha", "vmax")
MIRROR = np.array([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0])  # y → −y


def action_factors(numbers: np.ndarray) -> dict[str, float]:
    """Return the numbers (6,) of an action by their names."""
    return dict(zip(ACTION_COLUMNS, numbers.tolist(), strict=True))


@dataclass(frozen=True)
class Action:
    """a = (θ₁, r₁, θ₂, r₂, α, v_max), in the robot base's polar frame."""

    theta1_rad: float  # where the first arc ends and the tool turns, at r₁
    r1_m: float
    theta2_rad: float  # where the second arc ends, at r₂
    r2_m: float
    alpha_rad: float  # wrist rotation about z added along the second arc
    vmax_m_s: float  # largest speed of the tool

    def __post_init__(self) -> None:
        for name, value in zip(ACTION_COLUMNS, self.as_array(), strict=True):
            if not math.isfinite(value):
                raise ValueError(f"action: {name} must be a finite number, got {value}")

    @classmethod
    def from_array(cls, values: np.ndarray) -> "Action":
        """Make an action from (6,) values in the order of `ACTION_COLUMNS`."""
        return cls(*(float(v) for v in values))

    def as_array(self) -> np.ndarray:
        """Return the action as (6,) values in the order of `ACTION_COLUMNS`."""
        return np.array(list(vars(self).values()))

    def mirrored(self) -> "Action":
        """Return the cast mirrored about the board's axis of symmetry (y → −y)."""
        return Action.from_array(self.as_array() * MIRROR)


@dataclass(frozen=True)
class ToolMotion:
    """Pose of the held end in time; at yaw 0 the cable leaves the gripper along +x."""

    t_s: np.ndarray  # (n,), increasing, 0 at the start of the cast
    pose: np.ndarray  # (n, 3): x [m], y [m], yaw [rad, unwrapped]

    def at(self, t_s: np.ndarray) -> np.ndarray:
        """Return the pose at times `t_s` (m,) as (m, 3); held constant beyond the ends."""
        return np.stack([np.interp(t_s, self.t_s, column) for column in self.pose.T], axis=-1)
