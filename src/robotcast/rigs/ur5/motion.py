"""The joint angles of one cast's whole motion, and what they must keep to before the arm moves."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from robotcast.casts.plan import PlannedCast
from robotcast.casts.reset import ResetSettings, plan_reset
from robotcast.rigs.envelope import Envelope, broken_rules
from robotcast.rigs.kinematics import JOINTS, Gripper, joint_path, link_points, tilted_joint_path

UPRIGHT_RAD, HEIGHT_M = 0.02, 0.01  # how far the held end may be off where a reset starts
SWAY_RAD, SWAY_HZ, SWAYS = 0.06, 0.8, 3
WORST_SHOWN = 3


class JointMotion(NamedTuple):
    """Joint angles `joints_rad` (n, 6) at the controller's rate, at the times `t_s` (n,) from 0."""

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


class WholeMotion(NamedTuple):
    """All that one cast moves: the five-step reset from where the arm stands, then the cast."""

    reset: JointMotion
    cast: JointMotion


@dataclass(frozen=True)
class SafetyLimits:
    """What the arm may do."""

    reset: Envelope  # a reset lifts the tool off the board
    cast: Envelope
    jerk_rad_s3: tuple[float, ...]  # base to wrist 3
    start_rad: float  # how far a joint may stand from where the motion starts

    def __post_init__(self) -> None:
        jerk = np.asarray(self.jerk_rad_s3, dtype=float)
        if jerk.shape != (6,) or not (np.isfinite(jerk) & (jerk > 0)).all():
            raise ValueError(f"ur5: jerk_rad_s3 must be six positive numbers, got {jerk.tolist()}")
        if not 0 < self.start_rad <= 0.1:
            raise ValueError(f"ur5: start_rad must be in (0, 0.1], got {self.start_rad}")


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
    start = held_pose(live_rad, gripper)
    # A wrist cannot turn on for ever: the reset turns it back to where it started.
    reset = plan_reset(start, cable_length_m, r0_m=r0_m, settings=settings)
    path = tilted_joint_path(reset.position_m, reset.pitch_rad, reset.yaw_rad, gripper)
    path += turns_towards(live_rad, path[0])
    cast = joint_path(planned.tool, gripper)
    cast += turns_towards(path[-1], cast[0])
    return WholeMotion(JointMotion(reset.t_s, path), JointMotion(planned.tool.t_s, cast))


def sway(joints_rad: np.ndarray, period_s: float) -> JointMotion:
    """Return a short swaying of the base about (6,): the camera's clock is compared by it."""
    t_s = np.arange(int(SWAYS / SWAY_HZ / period_s) + 1) * period_s
    window = np.sin(np.pi * np.clip(t_s / t_s[-1], 0, 1)) ** 2
    path = np.tile(np.asarray(joints_rad, dtype=float), (len(t_s), 1))
    path[:, 0] += SWAY_RAD * window * np.sin(2 * np.pi * SWAY_HZ * t_s)
    return JointMotion(t_s, path)


def turns_towards(reference_rad: np.ndarray, joints_rad: np.ndarray) -> np.ndarray:
    """Return the whole turns (6,) [rad] that bring joints nearest to a reference."""
    return 2 * np.pi * np.round((np.asarray(reference_rad) - joints_rad) / (2 * np.pi))


def refuse_unsafe(whole: WholeMotion, live_rad: np.ndarray, limits: SafetyLimits) -> None:
    """Raise ValueError, one sentence, unless the arm (6,) may execute the whole motion."""
    refuse_motion(whole.reset, limits.reset, limits, "reset")
    refuse_motion(whole.cast, limits.cast, limits, "cast")
    for stands_rad, motion in ((live_rad, whole.reset), (whole.reset.joints_rad[-1], whole.cast)):
        away = np.abs(np.asarray(stands_rad, dtype=float) - motion.joints_rad[0])
        if not (away <= limits.start_rad).all():
            worst = int(np.argmax(np.where(np.isfinite(away), away, np.inf)))
            raise ValueError(
                f"ur5: {JOINTS[worst]} stands {np.degrees(away[worst]):.2f}° from where the motion "
                f"starts, at most {np.degrees(limits.start_rad):.2f}° is allowed; nothing moved"
            )


def refuse_motion(motion: JointMotion, envelope: Envelope, limits: SafetyLimits, name: str) -> None:
    """Raise ValueError unless a motion keeps to an envelope and to the jerk limits.

    Jerks are third differences of a motion between rests.
    """
    broken = [str(rule) for rule in broken_rules(motion.t_s, motion.joints_rad, envelope)]
    padded = np.pad(motion.joints_rad, ((3, 3), (0, 0)), mode="edge")
    step_s = np.median(np.diff(motion.t_s))
    jerks = np.abs(np.diff(padded, n=3, axis=0) / step_s**3).max(axis=0)
    for part, jerk, limit in zip(JOINTS, jerks, limits.jerk_rad_s3, strict=True):
        if not jerk <= limit:
            broken.append(f"joint jerk ({part}): {jerk:.4g}, limit {limit:.4g}")
    if broken:
        more = f" and {len(broken) - WORST_SHOWN} more" if len(broken) > WORST_SHOWN else ""
        raise ValueError(
            f"ur5: the {name} would break the envelope, nothing moved: "
            f"{'; '.join(broken[:WORST_SHOWN])}{more}"
        )
