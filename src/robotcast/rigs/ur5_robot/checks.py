"""What a motion must keep to before the arm is told any of it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robotcast.rigs.envelope import Envelope, broken_rules
from robotcast.rigs.ur5 import JOINTS
from robotcast.rigs.ur5_robot.motion import JointMotion, WholeMotion

WORST_SHOWN = 3


@dataclass(frozen=True)
class SafetyLimits:
    """What the arm may do.

    Attributes
    ----------
    reset, cast : envelopes of the two motions; a reset lifts the tool off the board.
    jerk_rad_s3 : six values, base to wrist 3.
    start_rad : how far a joint may stand from where the motion starts.
    """

    reset: Envelope
    cast: Envelope
    jerk_rad_s3: tuple[float, ...]
    start_rad: float

    def __post_init__(self) -> None:
        jerk = np.asarray(self.jerk_rad_s3, dtype=float)
        if jerk.shape != (6,) or not (np.isfinite(jerk) & (jerk > 0)).all():
            raise ValueError(f"ur5: jerk_rad_s3 must be six positive numbers, got {jerk.tolist()}")
        if not 0 < self.start_rad <= 0.1:
            raise ValueError(f"ur5: start_rad must be in (0, 0.1], got {self.start_rad}")


def refuse_unsafe(whole: WholeMotion, live_rad: np.ndarray, limits: SafetyLimits) -> None:
    """Raise ValueError, one sentence, unless the arm (6,) may execute the whole motion."""
    refuse_motion(whole.reset, limits.reset, limits, "reset")
    refuse_motion(whole.cast, limits.cast, limits, "cast")
    refuse_start(whole.reset, live_rad, limits)
    refuse_start(whole.cast, whole.reset.joints_rad[-1], limits)


def refuse_motion(motion: JointMotion, envelope: Envelope, limits: SafetyLimits, name: str) -> None:
    """Raise ValueError unless a motion keeps to an envelope and to the jerk limits."""
    broken: Sequence[object] = broken_rules(motion.t_s, motion.joints_rad, envelope)
    broken = [*broken, *_jerks(motion, limits)]
    if broken:
        shown = "; ".join(str(rule) for rule in broken[:WORST_SHOWN])
        more = f" and {len(broken) - WORST_SHOWN} more" if len(broken) > WORST_SHOWN else ""
        raise ValueError(f"ur5: the {name} would break the envelope, nothing moved: {shown}{more}")


def refuse_start(motion: JointMotion, live_rad: np.ndarray, limits: SafetyLimits) -> None:
    """Raise ValueError unless the arm (6,) stands where the motion starts."""
    away = np.abs(np.asarray(live_rad, dtype=float) - motion.joints_rad[0])
    if not (away <= limits.start_rad).all():
        worst = int(np.argmax(np.where(np.isfinite(away), away, np.inf)))
        raise ValueError(
            f"ur5: {JOINTS[worst]} stands {np.degrees(away[worst]):.2f}° from where the motion "
            f"starts, at most {np.degrees(limits.start_rad):.2f}° is allowed; nothing moved"
        )


def _jerks(motion: JointMotion, limits: SafetyLimits) -> list[str]:
    """Return which joints' jerk is too large, as third differences of a motion between rests."""
    path = motion.joints_rad
    padded = np.concatenate([np.repeat(path[:1], 3, axis=0), path, np.repeat(path[-1:], 3, axis=0)])
    step_s = np.median(np.diff(motion.t_s))
    jerk = np.abs(np.diff(padded, n=3, axis=0) / step_s**3).max(axis=0)
    return [
        f"joint jerk ({part}): {value:.4g}, limit {limit:.4g}"
        for part, value, limit in zip(JOINTS, jerk, limits.jerk_rad_s3, strict=True)
        if not value <= limit
    ]
