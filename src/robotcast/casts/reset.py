"""The five-step reset that lays the cable straight along the board's axis before a cast.

Paper, "Reset Procedure": lift with the free end touching the board; lift on until it is just
above; hang still; swing out of the plane so that the cable straightens along the axis and
lands far away; pull slowly back to (r₀, 0).
"""

from dataclasses import dataclass

import numpy as np

from robotcast.casts.curves import smooth_step


@dataclass(frozen=True)
class ResetSettings:
    """Shape and timing of the reset."""

    held_height_m: float = 0.02  # of the held end above the board while the cable lies on it
    hang_x_m: float = 0.45  # where the cable hangs
    hang_pitch_rad: float = 1.0  # of the tool meanwhile; pointing down the arm is too short
    loop_m: float = 0.03  # length lost where the cable bends over at the gripper
    # Horizontal part of the cable's length after the first step; the second drags the free end in
    # from there, slowly, so that it leaves the board without swinging.
    drag_fraction: float = 0.6
    clearance_m: float = 0.02  # left below the free end when it hangs
    back_x_m: float = 0.36  # how far towards the base the swing begins
    land_x_m: float = 0.81  # where it sets the held end down
    lift_s: float = 2.5
    raise_s: float = 4.0
    hang_s: float = 3.0
    back_s: float = 0.8  # of the swing's first part
    forward_s: float = 0.84  # of its second
    sink_delay_s: float = 0.8  # from there until the held end begins to sink
    sink_s: float = 0.8
    settle_s: float = 1.0  # waiting after the landing
    pull_s: float = 5.5
    rest_s: float = 1.5  # waiting before the cast
    period_s: float = 0.008  # of the samples

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value >= 0):
                raise ValueError(f"reset: {name} must be zero or positive, got {value}")
        if not self.back_x_m <= self.hang_x_m < self.land_x_m:
            raise ValueError(
                "reset: expected back_x_m ≤ hang_x_m < land_x_m, "
                f"got {self.back_x_m}, {self.hang_x_m}, {self.land_x_m}"
            )
        if not 0 < self.drag_fraction < 1:
            raise ValueError(f"reset: drag_fraction must be in (0, 1), got {self.drag_fraction}")


@dataclass(frozen=True)
class ResetMotion:
    """Pose of the held end in time, in three dimensions.

    At pitch 0 the tool points down and the cable leaves it level along the yaw; at a positive one
    the tool's tip and the cable's first piece are turned upwards by that angle.
    """

    t_s: np.ndarray  # (n,), from 0
    position_m: np.ndarray  # (n, 3); z above the board
    yaw_rad: np.ndarray  # (n,), 0 along +x
    pitch_rad: np.ndarray  # (n,)


def plan_reset(
    start_pose: np.ndarray, cable_length_m: float, *, r0_m: float, settings: ResetSettings
) -> ResetMotion:
    """Plan the reset from where a cast ended; the wrist turns back to yaw 0.

    The `start_pose` (3,) is x [m], y [m] and yaw [rad] of the held end; the cable's length is from
    there to the free end.
    """
    start_pose, s = np.asarray(start_pose, dtype=float), settings
    if start_pose.shape != (3,) or not np.isfinite(start_pose).all():
        raise ValueError(f"reset: start_pose must be x, y, yaw, all finite, got {start_pose}")
    if not s.loop_m + 0.1 <= cable_length_m <= 1.0:
        raise ValueError(
            f"reset: cable_length_m must be in [{s.loop_m + 0.1:g}, 1] m, got {cable_length_m}"
        )
    hung = s.lift_s + s.raise_s + s.hang_s
    swung = hung + (s.back_s + max(s.forward_s, s.sink_delay_s + s.sink_s))
    end = swung + (s.settle_s + s.pull_s + s.rest_s)
    t_s = np.arange(int(np.ceil(end / s.period_s - 1e-9)) + 1) * s.period_s

    def moved(start_s: float, duration_s: float) -> np.ndarray:
        """Return the part of a move from rest to rest that is done, (n,) from 0 to 1."""
        return smooth_step((t_s - start_s) / max(duration_s, 1e-9))

    x, y, yaw = start_pose
    lifting, raising = moved(0.0, s.lift_s), moved(s.lift_s, s.raise_s)
    sinking = moved(hung + s.back_s + s.sink_delay_s, s.sink_s)
    along_x = (
        x
        + (s.hang_x_m - x) * lifting
        + (s.back_x_m - s.hang_x_m) * moved(hung, s.back_s)
        + (s.land_x_m - s.back_x_m) * moved(hung + s.back_s, s.forward_s)
        + (r0_m - s.land_x_m) * moved(swung + s.settle_s, s.pull_s)
    )
    free, held = cable_length_m - s.loop_m, s.held_height_m
    drag = s.drag_fraction * free
    lifted = np.sqrt(free**2 - drag**2)
    hanging = np.sqrt(free**2 - (drag * (1 - raising)) ** 2) + s.clearance_m * raising
    top = free + s.clearance_m
    height = held + (lifted - held) * lifting + (hanging - lifted) + (held - top) * sinking
    position = np.stack([along_x, y * (1 - lifting), height], axis=1)
    pitch = s.hang_pitch_rad * (moved(0.0, s.lift_s + s.raise_s) - sinking)
    return ResetMotion(t_s, position, yaw - yaw * lifting, pitch)
