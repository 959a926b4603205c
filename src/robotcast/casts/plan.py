"""From the numbers of a cast to the motion of the tool; pulls, grids of actions, how arms follow.

Casts are simulated for tuning with the tool motions that were logged; those that nobody cast yet
are known by their plans alone. Between the two lies the arm: it comes late, rounds what is sharp
and may fall short. Any linear arm is an average over the recent past of what it was told; its
weights follow from the logs by least squares (`fit_following`).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from robotcast.casts.action import Action, ToolMotion
from robotcast.casts.curves import CastCurves, PlanLimits, plan_curves, smooth_step


@dataclass(frozen=True)
class PlannedCast:
    """A cast as it is told to an arm."""

    action: Action  # with r₁ filled in
    tool: ToolMotion  # sampled at the planning period from the start until the tool rests
    turn_s: float  # when the tool rests in θ₁
    end_s: float  # when it arrives in θ₂


def plan_action(action: Action, *, r0_m: float, limits: PlanLimits) -> PlannedCast:
    """Plan the cast of `action` (see `plan_actions`)."""
    return plan_actions(action.as_array()[None], r0_m=r0_m, limits=limits)[0]


def plan_actions(actions: np.ndarray, *, r0_m: float, limits: PlanLimits) -> list[PlannedCast]:
    """Plan the casts of `actions` (n, 6), columns `ACTION_COLUMNS`.

    The radius is a cubic spline from r₀ through r₁ at θ₁ to r₂, with zero slope at both ends. The
    angle goes from 0 to θ₁ and on to θ₂ as fast as v_max, the angular acceleration and the jerk
    allow, at rest in θ₁. α is blended into the yaw over the second arc by a quintic.
    """
    check_actions(actions, r0_m, limits)
    curves = plan_curves(actions, r0_m, limits)
    turn, end = curves.turn_s, curves.end_s
    counts = np.ceil(end / limits.period_s - 1e-9).astype(int) + 1
    planned = []
    for start in range(0, len(counts), 1024):
        chunk = slice(start, start + 1024)
        t_s = np.arange(counts[chunk].max()) * limits.period_s
        poses = curves.rows(chunk).poses_at(t_s)
        for row, pose in enumerate(poses, start):
            motion = ToolMotion(t_s[: counts[row]].copy(), pose[: counts[row]].copy())
            action = Action.from_array(curves.actions[row])
            planned.append(PlannedCast(action, motion, float(turn[row]), float(end[row])))
    return planned


def check_actions(actions: np.ndarray, r0_m: float, limits: PlanLimits) -> None:
    """Refuse actions (n, 6) that cannot be planned, naming the first, its value and the limit.

    An r₁ that is NaN is still to be filled in.
    """
    theta1, r1, theta2, r2, alpha, vmax = actions.T
    low, high, most = limits.r_min_m, limits.r_max_m, limits.vmax_m_s

    def check(values: np.ndarray, kept: np.ndarray, rule: str) -> None:
        if not kept.all():
            raise ValueError(f"cast: {rule}, got {values[~kept][0]:g}")

    def check_radius(name: str, radii: np.ndarray) -> None:
        kept = (radii >= low) & (radii <= high)
        check(radii, kept, f"{name} must be in [{low:g}, {high:g}] m")

    check_radius("r0", np.array([r0_m]))
    for name, angles, limit in (
        ("theta1", theta1, limits.angle_rad),
        ("theta2", theta2, limits.angle_rad),
        ("alpha", alpha, limits.alpha_rad),
    ):
        check(angles, np.abs(angles) <= limit, f"|{name}| must not exceed {limit:g} rad")
    check(vmax, (vmax > 0) & (vmax <= most), f"vmax must be in (0, {most:g}] m/s at the tool")
    bad = theta1 * (theta1 - theta2) <= 0
    if bad.any():
        raise ValueError(
            "cast: the second arc must turn back from theta1, "
            f"got theta1 {theta1[bad][0]:g} and theta2 {theta2[bad][0]:g} rad"
        )
    check_radius("r2", r2)
    check_radius("r1", r1[~np.isnan(r1)])


_PEAK = 1.875  # largest slope of the quintic from 0 to 1
_SHORTEST_S = 0.5


def pull_action(angle_rad: float, from_m: float, to_m: float, speed_m_s: float) -> Action:
    """Return a pull along one ray as an action: θ₁ = θ₂, from r₁ to r₂, at v_max at most."""
    return Action(angle_rad, from_m, angle_rad, to_m, 0.0, speed_m_s)


def plan_pull(action: Action, *, r0_m: float, limits: PlanLimits) -> PlannedCast:
    """Plan the tool motion of a pull: it lies in wait at r₁ and moves to r₂, at rest at both ends.

    The rig's r₀ is of casts: a pull starts where its own reset set the held end down.
    """
    if action.theta1_rad != action.theta2_rad or action.alpha_rad != 0:
        raise ValueError("pull: the held end stays on one ray, got theta1 ≠ theta2 or alpha ≠ 0")
    start, end = action.r1_m, action.r2_m
    if not limits.r_min_m <= end <= start <= limits.r_max_m:
        raise ValueError(
            f"pull: expected {limits.r_min_m:g} ≤ r2 ≤ r1 ≤ {limits.r_max_m:g} m, "
            f"got r1 {start:g} and r2 {end:g}"
        )
    if abs(action.theta1_rad) > limits.angle_rad or action.vmax_m_s <= 0:
        raise ValueError(
            f"pull: |theta| must not exceed {limits.angle_rad:g} rad and vmax must be positive, "
            f"got {action.theta1_rad:g} and {action.vmax_m_s:g}"
        )
    end_s = max(_SHORTEST_S, _PEAK * (start - end) / action.vmax_m_s)
    t_s = np.arange(math.ceil(end_s / limits.period_s - 1e-9) + 1) * limits.period_s
    radius = start + (end - start) * smooth_step(t_s / end_s)
    angle = np.full(len(t_s), action.theta1_rad)
    pose = np.stack([radius * np.cos(angle), radius * np.sin(angle), angle], axis=1)
    return PlannedCast(action, ToolMotion(t_s, pose), 0.0, end_s)


@dataclass(frozen=True)
class ActionGrid:
    """Evenly spaced values of θ₁, θ₂, r₂, α and v_max, each [first, last], and how many by name.

    Only the half θ₁ > 0, θ₂ < 0, α ≥ 0 is sampled; mirror images are the other half (paper,
    "Parameterized Actions").
    """

    theta1_rad: tuple[float, float]
    theta2_rad: tuple[float, float]
    r2_m: tuple[float, float]
    alpha_rad: tuple[float, float]
    vmax_m_s: tuple[float, float]
    counts: Mapping[str, int]

    def __post_init__(self) -> None:
        for name, count in self.counts.items():
            if count < 1:
                raise ValueError(f"grid: the count of {name} must be at least 1, got {count}")
        for name, kept, rule in (
            ("theta1_rad", min(self.theta1_rad) > 0, "positive"),
            ("theta2_rad", max(self.theta2_rad) < 0, "negative"),
            ("alpha_rad", min(self.alpha_rad) >= 0, "zero or positive"),
        ):
            if not kept:
                raise ValueError(f"grid: {name} must be {rule}, got {list(getattr(self, name))}")

    def axes(self) -> list[tuple[float, float, int]]:
        """Return first, last and count of θ₁, θ₂, r₂, α and v_max."""
        ends = (self.theta1_rad, self.theta2_rad, self.r2_m, self.alpha_rad, self.vmax_m_s)
        counts = (self.counts[name] for name in ("theta1", "theta2", "r2", "alpha", "vmax"))
        return [(first, last, count) for (first, last), count in zip(ends, counts, strict=True)]

    @property
    def size(self) -> int:
        """How many actions it holds."""
        return math.prod(self.counts.values())

    def curves(self, r0_m: float, limits: PlanLimits) -> CastCurves:
        """Return the curves of every action of the grid, the last coordinate fastest."""
        axes = [np.linspace(*axis) for axis in self.axes()]
        axes.insert(1, np.array([np.nan]))
        actions = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 6)
        check_actions(actions, r0_m, limits)
        return plan_curves(actions, r0_m, limits)


PAST_S = 0.2  # an arm that is later than this is not followed
SMOOTHNESS = 1e-3  # of the weights: (1 mm that no such model explains / bends of 0.03) squared
BELIEVED_M = 0.02  # what an arm may do otherwise, and still have been told these plans
DECIMALS = 6
LEVER_M = 0.3  # makes an angle as weighty as a distance


@dataclass(frozen=True)
class Following:
    """An arm that takes a weighted mean of what it was told lately."""

    period_s: float  # between two weights
    weights: np.ndarray  # (k,), of the motion told now, a period ago and so on
    told_rms_m: float  # root mean square of how far logged tools lie from what was told
    followed_rms_m: float  # and from this model

    @property
    def believed(self) -> bool:
        """Whether the logged motions come from the plans at all; recorded casts may have others."""
        return self.followed_rms_m <= BELIEVED_M

    @property
    def lag_s(self) -> float:
        """How late the arm is at constant speed."""
        late_s = np.arange(len(self.weights)) * self.period_s
        return float(self.weights @ late_s / self.weights.sum())

    def motion(self, told: ToolMotion) -> ToolMotion:
        """Return what the tool does when it is told `told`, until it has come to rest."""
        after = np.arange(1, len(self.weights)) * self.period_s
        t_s = np.concatenate([told.t_s, told.t_s[-1] + after])
        past = _past(told, t_s, self.period_s, len(self.weights))
        return ToolMotion(t_s, told.pose[0] + past @ self.weights)


def exact_following(period_s: float) -> Following:
    """Return an arm that does as it is told."""
    return Following(period_s, np.ones(1), 0.0, 0.0)


def fit_following(pairs: Sequence[tuple[ToolMotion, ToolMotion]], period_s: float) -> Following:
    """Return how an arm follows, from pairs of a motion that it was told and the one it then made.

    Excursions from each motion's start are compared, so that a calibration that puts the board
    or the tool somewhere else does not count. Both have time 0 at the start of the cast.
    """
    count = round(PAST_S / period_s) + 1
    scale = np.array([1.0, 1.0, LEVER_M])
    told = [_past(told, made.t_s, period_s, count) * scale[:, None] for told, made in pairs]
    past = np.concatenate(told).reshape(-1, count)
    made = np.concatenate([((m.pose - m.pose[0]) * scale).ravel() for _, m in pairs])
    bends = np.diff(np.eye(count), 2, axis=0)
    square = past.T @ past + SMOOTHNESS * bends.T @ bends
    weights = np.linalg.lstsq(square, past.T @ made, rcond=None)[0]
    weights = weights.round(DECIMALS)  # sums on more threads differ by less
    return Following(period_s, weights, _rms(past[:, 0] - made), _rms(past @ weights - made))


def _past(told: ToolMotion, t_s: np.ndarray, period_s: float, count: int) -> np.ndarray:
    """Return excursions (n, 3, count) from the start that were told 0, 1, … periods before."""
    excursions = [told.at(t_s - k * period_s) - told.pose[0] for k in range(count)]
    return np.stack(excursions, axis=-1)


def _rms(away: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(away)) * 3))
