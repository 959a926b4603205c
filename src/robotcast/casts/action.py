"""The six numbers of a cast (paper, "Parameterized Actions"), and the motion of its held end."""

import math
from dataclasses import dataclass, replace

import numpy as np

ACTION_COLUMNS = ("theta1", "r1", "theta2", "r2", "alpha", "vmax")


def action_factors(numbers: np.ndarray) -> dict[str, float]:
    """Return the numbers (6,) of an action by their names."""
    return dict(zip(ACTION_COLUMNS, numbers.tolist(), strict=True))


@dataclass(frozen=True)
class Action:
    """a = (θ₁, r₁, θ₂, r₂, α, v_max), in the robot base's polar frame.

    Attributes
    ----------
    theta1_rad, r1_m : where the first arc ends and the tool turns.
    theta2_rad, r2_m : where the second arc ends.
    alpha_rad : wrist rotation about z added along the second arc.
    vmax_m_s : largest speed of the tool.
    """

    theta1_rad: float
    r1_m: float
    theta2_rad: float
    r2_m: float
    alpha_rad: float
    vmax_m_s: float

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
        return np.array(
            [
                self.theta1_rad,
                self.r1_m,
                self.theta2_rad,
                self.r2_m,
                self.alpha_rad,
                self.vmax_m_s,
            ]
        )

    def mirrored(self) -> "Action":
        """Return the cast mirrored about the board's axis of symmetry (y → −y)."""
        return replace(
            self,
            theta1_rad=-self.theta1_rad,
            theta2_rad=-self.theta2_rad,
            alpha_rad=-self.alpha_rad,
        )


@dataclass(frozen=True)
class ToolMotion:
    """Pose of the held end in time.

    Attributes
    ----------
    t_s : ndarray of shape (n,), increasing, 0 at the start of the cast.
    pose : ndarray of shape (n, 3): x [m], y [m], yaw [rad, unwrapped]; at yaw 0 the cable
        leaves the gripper along +x.
    """

    t_s: np.ndarray
    pose: np.ndarray

    def at(self, t_s: np.ndarray) -> np.ndarray:
        """Return the pose at times `t_s` (m,) as (m, 3); held constant beyond the ends."""
        return np.stack([np.interp(t_s, self.t_s, column) for column in self.pose.T], axis=-1)

    def mirrored(self) -> "ToolMotion":
        """Return the motion mirrored about the board's axis of symmetry (y → −y)."""
        return ToolMotion(self.t_s, self.pose * np.array([1.0, -1.0, -1.0]))
