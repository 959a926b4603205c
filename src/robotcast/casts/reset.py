"""The five-step reset that lays the cable straight along the board's axis before a cast.

Paper, "Reset Procedure": lift with the free end touching the board; lift on until it is just
above; hang still; swing out of the plane so that the cable straightens along the axis and
lands far away; pull slowly back to (r₀, 0).
"""

from dataclasses import dataclass, fields

import numpy as np

from robotcast.casts.curves import smooth_step

STEPS = ("lift", "raise", "hang", "swing", "pull")


@dataclass(frozen=True)
class ResetSettings:
    """Shape and timing of the reset.

    Attributes
    ----------
    held_height_m : of the held end above the board while the cable lies on it.
    hang_x_m : where the cable hangs.
    hang_pitch_rad : of the tool while the cable hangs; pointing down the arm is too short.
    loop_m : length lost where the cable bends over at the gripper.
    drag_fraction : horizontal part of the cable's length after the first step; the second
        drags the free end in from there, slowly, so that it leaves the board without swinging.
    clearance_m : left below the free end when it hangs.
    back_x_m, land_x_m : how far towards the base the swing begins, and where it sets the held
        end down.
    lift_s, raise_s, hang_s : durations of the first three steps.
    back_s, forward_s : of the two parts of the swing.
    sink_delay_s, sink_s : when, after the forward swing began, the held end begins to sink,
        and for how long it does.
    settle_s, pull_s, rest_s : waiting after the landing, pulling, waiting before the cast.
    period_s : sample period.
    """

    held_height_m: float = 0.02
    hang_x_m: float = 0.45
    hang_pitch_rad: float = 1.0
    loop_m: float = 0.03
    drag_fraction: float = 0.6
    clearance_m: float = 0.02
    back_x_m: float = 0.36
    land_x_m: float = 0.81
    lift_s: float = 2.5
    raise_s: float = 4.0
    hang_s: float = 3.0
    back_s: float = 0.8
    forward_s: float = 0.84
    sink_delay_s: float = 0.8
    sink_s: float = 0.8
    settle_s: float = 1.0
    pull_s: float = 5.5
    rest_s: float = 1.5
    period_s: float = 0.008

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (np.isfinite(value) and value >= 0):
                raise ValueError(f"reset: {field.name} must be zero or positive, got {value}")
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

    Attributes
    ----------
    t_s : ndarray of shape (n,), from 0.
    position_m : ndarray of shape (n, 3), of the held end; z above the board.
    yaw_rad : ndarray of shape (n,), 0 along +x.
    pitch_rad : ndarray of shape (n,): 0 with the tool pointing down and the cable leaving it
        level along the yaw; positive with the tool's tip and the cable's first piece turned
        upwards by that angle.
    step_end_s : ndarray of shape (5,), when each of the `STEPS` ends.
    """

    t_s: np.ndarray
    position_m: np.ndarray
    yaw_rad: np.ndarray
    pitch_rad: np.ndarray
    step_end_s: np.ndarray


def plan_reset(
    start_pose: np.ndarray,
    cable_length_m: float,
    *,
    r0_m: float,
    settings: ResetSettings,
    end_yaw_rad: float | None = None,
) -> ResetMotion:
    """Plan the reset from where a cast ended.

    Parameters
    ----------
    start_pose : ndarray of shape (3,), x [m], y [m], yaw [rad] of the held end.
    cable_length_m : from the held end to the free end.
    end_yaw_rad : to where the wrist turns back; the nearest whole turn when None.
    """
    start_pose = np.asarray(start_pose, dtype=float)
    if start_pose.shape != (3,) or not np.isfinite(start_pose).all():
        raise ValueError(f"reset: start_pose must be x, y, yaw, all finite, got {start_pose}")
    if not settings.loop_m + 0.1 <= cable_length_m <= 1.0:
        raise ValueError(
            f"reset: cable_length_m must be in [{settings.loop_m + 0.1:g}, 1] m, "
            f"got {cable_length_m}"
        )
    ends = _step_ends(settings)
    t_s = np.arange(int(np.ceil(ends[-1] / settings.period_s - 1e-9)) + 1) * settings.period_s
    x, y, yaw = start_pose
    end_yaw = 2 * np.pi * round(yaw / (2 * np.pi)) if end_yaw_rad is None else end_yaw_rad
    lifting = _moved(t_s, 0.0, settings.lift_s)
    position = np.stack(
        [
            _along_x(t_s, x, r0_m, settings),
            y * (1 - lifting),
            _height(t_s, cable_length_m, settings),
        ],
        axis=1,
    )
    raised = _moved(t_s, 0.0, settings.lift_s + settings.raise_s)
    pitch = settings.hang_pitch_rad * (raised - _sunk(t_s, settings))
    return ResetMotion(t_s, position, yaw + (end_yaw - yaw) * lifting, pitch, ends)


def _step_ends(settings: ResetSettings) -> np.ndarray:
    forward_s = max(settings.forward_s, settings.sink_delay_s + settings.sink_s)
    durations = [
        settings.lift_s,
        settings.raise_s,
        settings.hang_s,
        settings.back_s + forward_s,
        settings.settle_s + settings.pull_s + settings.rest_s,
    ]
    return np.cumsum(durations)


def _along_x(t_s: np.ndarray, x: float, r0_m: float, settings: ResetSettings) -> np.ndarray:
    _, _, hung, swung, _ = _step_ends(settings)
    hang, back, land = settings.hang_x_m, settings.back_x_m, settings.land_x_m
    return (
        x
        + (hang - x) * _moved(t_s, 0.0, settings.lift_s)
        + (back - hang) * _moved(t_s, hung, settings.back_s)
        + (land - back) * _moved(t_s, hung + settings.back_s, settings.forward_s)
        + (r0_m - land) * _moved(t_s, swung + settings.settle_s, settings.pull_s)
    )


def _height(t_s: np.ndarray, cable_length_m: float, settings: ResetSettings) -> np.ndarray:
    free = cable_length_m - settings.loop_m
    held = settings.held_height_m
    drag = settings.drag_fraction * free
    lifted = np.sqrt(free**2 - drag**2)
    raised = _moved(t_s, settings.lift_s, settings.raise_s)
    hanging = np.sqrt(free**2 - (drag * (1 - raised)) ** 2) + settings.clearance_m * raised
    top = free + settings.clearance_m
    return (
        held
        + (lifted - held) * _moved(t_s, 0.0, settings.lift_s)
        + (hanging - lifted)
        + (held - top) * _sunk(t_s, settings)
    )


def _sunk(t_s: np.ndarray, settings: ResetSettings) -> np.ndarray:
    start = _step_ends(settings)[2] + settings.back_s + settings.sink_delay_s
    return _moved(t_s, start, settings.sink_s)


def _moved(t_s: np.ndarray, start_s: float, duration_s: float) -> np.ndarray:
    """Return the part of a move from rest to rest that is done, (n,) from 0 to 1."""
    return smooth_step((t_s - start_s) / max(duration_s, 1e-9))
