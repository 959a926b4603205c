"""From a planned cast and where the arm stands to the joint angles of the whole motion."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from robotcast.casts.plan import PlannedCast
from robotcast.casts.reset import ResetSettings, plan_reset
from robotcast.rigs.ur5 import Gripper, joint_path, link_points, tilted_joint_path

UPRIGHT_RAD = 0.02
HEIGHT_M = 0.01
SWAY_RAD, SWAY_HZ, SWAYS = 0.06, 0.8, 3


@dataclass(frozen=True)
class JointMotion:
    """Joint angles at the controller's rate.

    Attributes
    ----------
    t_s : ndarray of shape (n,), from 0.
    joints_rad : ndarray of shape (n, 6).
    """

    t_s: np.ndarray
    joints_rad: np.ndarray

    def at_speed(self, speed: float, period_s: float) -> "JointMotion":
        """Return the same path at `speed` times the speed, one sample a `period_s`."""
        if not 0 < speed <= 1:
            raise ValueError(f"ur5: a speed must be in (0, 1], got {speed:g}")
        times = self.t_s / speed
        t_s = np.arange(int(np.ceil(times[-1] / period_s - 1e-9)) + 1) * period_s
        if len(t_s) == len(times) and np.allclose(t_s, times):
            return self
        path = CubicSpline(times, self.joints_rad, bc_type="clamped")
        return JointMotion(t_s, path(np.minimum(t_s, times[-1])))

    def held(self, before_s: float, after_s: float, period_s: float) -> "JointMotion":
        """Return the motion with its first and last joints held for so long."""
        counts = round(before_s / period_s), round(after_s / period_s)
        joints = np.pad(self.joints_rad, (counts, (0, 0)), mode="edge")
        return JointMotion(np.arange(len(joints)) * period_s, joints)

    def end(self) -> "JointMotion":
        """Return the last sample alone."""
        return JointMotion(self.t_s[-1:], self.joints_rad[-1:])


@dataclass(frozen=True)
class WholeMotion:
    """All that one cast moves: the five-step reset from where the arm stands, then the cast."""

    reset: JointMotion
    cast: JointMotion


def held_pose(joints_rad: np.ndarray, gripper: Gripper) -> np.ndarray:
    """Return x [m], y [m], yaw [rad] of the held end of an arm (6,) that points down.

    Raises ValueError when the tool is tilted or not at the height at which it holds the cable:
    a reset can be planned from there only.
    """
    joints = np.asarray(joints_rad, dtype=float)
    if joints.shape != (6,) or not np.isfinite(joints).all():
        raise ValueError(f"ur5: expected six finite joint angles, got {joints.tolist()}")
    *_, flange, _, held = link_points(joints, gripper)
    tilt = np.arccos(np.clip((flange - held)[2] / np.linalg.norm(flange - held), -1, 1))
    above = held[2] - gripper.held_height_m
    if tilt > UPRIGHT_RAD or abs(above) > HEIGHT_M:
        raise ValueError(
            f"ur5: the tool stands {above * 1e3:.0f} mm above its height over the board and is "
            f"tilted by {np.degrees(tilt):.1f}°; a reset starts from a tool that points down and "
            f"holds the cable {gripper.held_height_m * 1e3:.0f} mm above the board"
        )
    return np.array([held[0], held[1], joints[0] - np.pi / 2 - joints[5]])


def plan_whole(
    planned: PlannedCast,
    live_rad: np.ndarray,
    cable_length_m: float,
    *,
    r0_m: float,
    settings: ResetSettings,
    gripper: Gripper,
) -> WholeMotion:
    """Plan the reset from where the arm stands, (6,), and the cast after it."""
    if not np.isfinite(planned.tool.pose).all():
        raise ValueError("ur5: the planned cast holds numbers that are not finite")
    start = held_pose(live_rad, gripper)
    # A wrist cannot turn on for ever: the reset turns it back to where it started.
    reset = plan_reset(start, cable_length_m, r0_m=r0_m, settings=settings, end_yaw_rad=0.0)
    path = tilted_joint_path(reset.position_m, reset.pitch_rad, reset.yaw_rad, gripper)
    path += _turns(live_rad, path[0])
    cast = joint_path(planned.tool, gripper)
    cast += _turns(path[-1], cast[0])
    return WholeMotion(JointMotion(reset.t_s, path), JointMotion(planned.tool.t_s, cast))


def sway(joints_rad: np.ndarray, period_s: float) -> JointMotion:
    """Return a short swaying of the base about (6,): the camera's clock is compared by it."""
    t_s = np.arange(int(SWAYS / SWAY_HZ / period_s) + 1) * period_s
    share = np.clip(t_s / t_s[-1], 0, 1)
    window = np.sin(np.pi * share) ** 2
    path = np.tile(np.asarray(joints_rad, dtype=float), (len(t_s), 1))
    path[:, 0] += SWAY_RAD * window * np.sin(2 * np.pi * SWAY_HZ * t_s)
    return JointMotion(t_s, path)


def _turns(reference: np.ndarray, joints: np.ndarray) -> np.ndarray:
    """Return the whole turns (6,) that bring `joints` nearest to `reference`."""
    return 2 * np.pi * np.round((np.asarray(reference) - joints) / (2 * np.pi))
