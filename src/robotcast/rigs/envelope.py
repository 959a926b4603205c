"""The safety envelope: what the arm may do, checked along a whole motion before it moves.

A motion is a sequence of joint angles, at rest before its first and after its last sample.
Speeds and accelerations are finite differences of those samples, so a jump between two of
them, or a motion that does not start and end at rest, breaks a limit. An action is feasible when
neither its motion nor the mirror image breaks a rule.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from robotcast.casts.curves import CastCurves, PlanLimits, distinct_arcs, plan_curves
from robotcast.casts.plan import ActionGrid
from robotcast.rigs import kinematics
from robotcast.running import Progress, silent

HAND_LINKS = ("wrist 1", "wrist 2", "wrist 3", "gripper", "fingers")
BASE_LINKS = ("forearm", *HAND_LINKS)
BOARD_LINKS = ("upper arm", "elbow", *BASE_LINKS)
PAIRS = (
    *(("base collision", link, "column") for link in BASE_LINKS),
    ("self collision", "shoulder", "forearm"),
    *(("self collision", a, h) for a in ("shoulder", "upper arm", "elbow") for h in HAND_LINKS),
    *(("self collision", "forearm", hand) for hand in HAND_LINKS[2:]),
)
"""Pieces that do not touch by construction."""

JOINT_SAMPLE_S = 0.004
PLACE_SAMPLE_S = 0.008
ROWS_AT_ONCE = 256
AS_IT_IS, MIRRORED = np.ones(3), np.array([1.0, -1.0, -1.0])  # of x, y, yaw


@dataclass(frozen=True)
class ToolBox:
    """Where the held end may be, [low, high] in the board's frame."""

    x_m: tuple[float, float]
    y_m: tuple[float, float]
    z_m: tuple[float, float]
    r_min_m: float  # radius about the base's axis that it keeps out of

    def __post_init__(self) -> None:
        for name in ("x_m", "y_m", "z_m"):
            low, high = getattr(self, name)
            if not low < high:
                raise ValueError(f"tool box: {name} must be [low, high], got [{low}, {high}]")
        if not self.r_min_m >= 0:
            raise ValueError(f"tool box: r_min_m must be zero or positive, got {self.r_min_m}")


@dataclass(frozen=True)
class Envelope:
    """Limits of the joints, six values each from base to wrist 3, and of the held end."""

    joint_min_rad: tuple[float, ...]
    joint_max_rad: tuple[float, ...]
    joint_speed_rad_s: tuple[float, ...]
    joint_acceleration_rad_s2: tuple[float, ...]
    tool_speed_m_s: float
    clearance_m: float  # between the arm's capsules, and between them and the board and the base
    box: ToolBox
    gripper: kinematics.Gripper

    def __post_init__(self) -> None:
        names = [field.name for field in fields(self)]
        for name in names[:4]:
            values = getattr(self, name)
            if len(values) != 6 or not np.isfinite(values).all():
                raise ValueError(f"envelope: {name} must be six finite numbers, got {values}")
        if not np.less(self.joint_min_rad, self.joint_max_rad).all():
            raise ValueError("envelope: joint_min_rad must be below joint_max_rad for every joint")
        for name in names[2:6]:
            value = np.min(getattr(self, name))
            if not (np.isfinite(value) and value > 0):
                raise ValueError(f"envelope: {name} must be positive and finite, got {value}")


@dataclass(frozen=True)
class BrokenRule:
    """One rule broken by a motion, where it is broken worst."""

    rule: str  # as `_Measured` names them
    part: str  # the joint, link, pair of links or coordinate concerned
    t_s: float
    value: float  # in the rule's SI unit; a distance must stay above its limit
    limit: float

    def __str__(self) -> str:
        return (
            f"{self.rule} ({self.part}): {self.value:.4g} at t = {self.t_s:.3f} s, "
            f"limit {self.limit:.4g}"
        )


class _Measured(NamedTuple):
    """A quantity along many motions: `value` (n, m) at `t_s` (m,), kept within [low, high]."""

    rule: str
    part: str
    t_s: np.ndarray
    value: np.ndarray
    low: float
    high: float = np.inf

    def excess(self) -> np.ndarray:  # positive where broken
        return np.maximum(self.value - self.high, self.low - self.value)


Measure = Callable[[np.ndarray, np.ndarray, Envelope], Iterator[_Measured]]


def broken_rules(t_s: np.ndarray, joints: np.ndarray, envelope: Envelope) -> list[BrokenRule]:
    """Return every rule that a motion breaks, each at its worst; empty when it may be executed.

    The motion is `joints` (n, 6) [rad] at the increasing times `t_s` (n,).
    """
    t_s, joints = np.asarray(t_s, dtype=float), np.asarray(joints, dtype=float)
    if joints.shape != (len(t_s), 6) or len(t_s) < 2:
        raise ValueError(
            f"envelope: expected joints (n, 6) for n ≥ 2 times, got {joints.shape} for {len(t_s)}"
        )
    for name, values in (("times", t_s[:, None]), ("joint angles", joints)):
        if (bad := ~np.isfinite(values).all(axis=1)).any():
            raise ValueError(f"envelope: {name} are not finite at sample {int(np.argmax(bad))}")
    if not (np.diff(t_s) > 0).all():
        raise ValueError("envelope: times must increase")
    broken = []
    for measure in (_measure_joints, _measure_tool, _measure_clearances):
        for measured in measure(t_s, joints[None], envelope):
            excess = measured.excess()[0]
            worst = int(np.argmax(excess))
            if excess[worst] > 0:
                value, when = float(measured.value[0, worst]), float(measured.t_s[worst])
                limit = measured.low if value < measured.low else measured.high
                broken.append(BrokenRule(measured.rule, measured.part, when, value, limit))
    return broken


def _measure_joints(t_s: np.ndarray, joints: np.ndarray, envelope: Envelope) -> Iterator[_Measured]:
    """Measure single joints."""
    padded_s = np.concatenate([[2 * t_s[0] - t_s[1]], t_s, [2 * t_s[-1] - t_s[-2]]])
    middle_s = (padded_s[1:] + padded_s[:-1]) / 2
    for index, part in enumerate(kinematics.JOINTS):
        angle = joints[..., index]
        low, high = envelope.joint_min_rad[index], envelope.joint_max_rad[index]
        yield _Measured("joint position", part, t_s, angle, low, high)
        rate = np.diff(angle, axis=1, prepend=angle[:, :1], append=angle[:, -1:])
        rate /= np.diff(padded_s)
        limit = envelope.joint_speed_rad_s[index]
        yield _Measured("joint speed", part, middle_s, rate, -limit, limit)
        acceleration = np.diff(rate, axis=1) / np.diff(middle_s)
        limit = envelope.joint_acceleration_rad_s2[index]
        yield _Measured("joint acceleration", part, t_s, acceleration, -limit, limit)


def _measure_tool(t_s: np.ndarray, joints: np.ndarray, envelope: Envelope) -> Iterator[_Measured]:
    """Measure the held end's place and speed, whatever the angle of wrist 3."""
    tool, box = kinematics.link_points(joints, envelope.gripper)[..., -1, :], envelope.box
    for index, limits in enumerate((box.x_m, box.y_m, box.z_m)):
        yield _Measured("tool box", "xyz"[index], t_s, tool[..., index], *limits)
    radius = np.hypot(tool[..., 0], tool[..., 1])
    yield _Measured("tool keep-out", "radius", t_s, radius, box.r_min_m)
    speed = np.linalg.norm(np.diff(tool, axis=1), axis=2) / np.diff(t_s)
    middle_s = (t_s[1:] + t_s[:-1]) / 2
    yield _Measured("tool speed", "held end", middle_s, speed, 0.0, envelope.tool_speed_m_s)


def _measure_clearances(
    t_s: np.ndarray, joints: np.ndarray, envelope: Envelope
) -> Iterator[_Measured]:
    """Measure board, base and arm itself, whatever the angles of base and wrist 3."""
    axes = kinematics.capsule_axes(kinematics.link_points(joints, envelope.gripper))
    radii = {link: capsule.radius_m for link, capsule in kinematics.LINK_CAPSULES.items()}
    for link in BOARD_LINKS:
        start, end = axes[link]
        height = np.minimum(start[..., 2], end[..., 2]) - radii[link]
        clearance = 0.0 if link == "fingers" else envelope.clearance_m
        yield _Measured("board collision", link, t_s, height, clearance)
    for rule, one, other in PAIRS:
        gap = kinematics.segment_distance(*axes[one], *axes[other]) - radii[one] - radii[other]
        part = one if other == "column" else f"{one} and {other}"
        yield _Measured(rule, part, t_s, gap, envelope.clearance_m)


def feasible_actions(
    grid: ActionGrid,
    r0_m: float,
    limits: PlanLimits,
    envelope: Envelope,
    progress: Progress = silent,
) -> np.ndarray:
    """Return the actions of the grid that the arm can do, (m, 6).

    It must do the mirror image too: the arm is not symmetric, and a policy uses both.
    """
    curves = grid.curves(r0_m, limits)
    return curves.actions[_are_feasible(curves, envelope, progress)]


def are_feasible(
    actions: np.ndarray, r0_m: float, limits: PlanLimits, envelope: Envelope
) -> np.ndarray:
    """Tell which of `actions` (n, 6) the arm can do, mirrored or not, (n,) of bool."""
    return _are_feasible(plan_curves(actions, r0_m, limits), envelope, silent)


def _are_feasible(curves: CastCurves, envelope: Envelope, progress: Progress) -> np.ndarray:
    first, member = distinct_arcs(curves.actions)  # α turns the wrist alone
    arcs, both = curves.rows(first), (AS_IT_IS, MIRRORED)
    broken = _broken_in(_measure_tool, arcs, PLACE_SAMPLE_S, envelope, both)
    broken |= _broken_in(_measure_clearances, arcs, PLACE_SAMPLE_S, envelope, (AS_IT_IS,))
    joints = _broken_in(_measure_joints, curves, JOINT_SAMPLE_S, envelope, both, progress)
    return ~(broken[member] | joints)


def _broken_in(
    measure: Measure,
    curves: CastCurves,
    sample_s: float,
    envelope: Envelope,
    images: tuple[np.ndarray, ...],
    progress: Progress = silent,
) -> np.ndarray:
    """Tell which casts break a rule, or go beyond the arm's reach, in any image, (n,) of bool."""
    n = len(curves.actions)
    broken, order = np.zeros(n, dtype=bool), np.argsort(curves.end_s, kind="stable")
    for start in range(0, n, ROWS_AT_ONCE):
        rows = order[start : start + ROWS_AT_ONCE]
        some = curves.rows(rows)
        t_s = np.arange(0.0, some.end_s.max() + 2 * sample_s, sample_s)
        pose = some.poses_at(t_s)
        for image in images:
            joints = kinematics.joints_pointing_down(pose * image, envelope.gripper)
            for measured in measure(t_s, joints, envelope):
                broken[rows] |= ~(measured.excess() <= 0).all(axis=1)  # NaN out of reach
        progress(start + len(rows), n, "filtering")
    return broken
