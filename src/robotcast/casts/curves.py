"""Many casts at once as analytic curves: angle, radius and blend as functions of time.

Along the angle the tool moves from rest to rest with limited jerk, as ruckig plans it.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
import ruckig


@dataclass(frozen=True)
class PlanLimits:
    """Limits of the planned tool motion."""

    angular_acceleration_rad_s2: float = 15.0  # of the polar angle θ(t), as is the jerk
    angular_jerk_rad_s3: float = 250.0
    period_s: float = 0.008  # of its samples
    vmax_m_s: float = 2.5  # largest v_max that may be asked for
    angle_rad: float = 1.5  # largest |θ₁| and |θ₂|
    alpha_rad: float = math.pi  # largest |α|
    r_min_m: float = 0.5  # between these radii the tool may plan to move
    r_max_m: float = 0.9

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"plan limits: {name} must be positive, got {value}")
        if self.r_min_m >= self.r_max_m:
            raise ValueError(
                f"plan limits: r_min_m must be below r_max_m, got {self.r_min_m}, {self.r_max_m}"
            )


PIECES = 7  # of constant jerk in one move
SAMPLES_PER_PIECE = 32
SPEED_MARGIN = 5e-4  # the planned peak stays so much below v_max: peaks between samples have room
SPEED_TOLERANCE = 1e-6
ROUNDS = 100


@dataclass(frozen=True)
class CastCurves:
    """Planned casts, one a row (paper, "Parameterized Actions").

    θ(t) is made of pieces of constant jerk: seven from 0 to θ₁ and seven from θ₁ to θ₂, at rest in
    between.
    """

    actions: np.ndarray  # (n, 6), columns `ACTION_COLUMNS`, r₁ filled in
    r0_m: float  # radius where every cast starts
    durations_s: np.ndarray  # (n, 14) of the pieces
    jerks_rad_s3: np.ndarray

    @property
    def turn_s(self) -> np.ndarray:
        """When each tool rests in θ₁, (n,)."""
        return self.durations_s[:, :PIECES].sum(axis=1)

    @property
    def end_s(self) -> np.ndarray:
        """When each tool arrives in θ₂, (n,)."""
        return self.turn_s + self.durations_s[:, PIECES:].sum(axis=1)

    def rows(self, chosen: slice | np.ndarray) -> "CastCurves":
        """Return the chosen casts."""
        arrays = {name: a[chosen] for name, a in vars(self).items() if name != "r0_m"}
        return replace(self, **arrays)

    def _piece_states(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return time, angular rate and acceleration where each piece begins, each (n, 14)."""
        t, j = self.durations_s, self.jerks_rad_s3
        change = j * t
        acceleration = np.cumsum(change, axis=1) - change
        change = (j / 2 * t + acceleration) * t
        return np.cumsum(t, axis=1) - t, np.cumsum(change, axis=1) - change, acceleration

    def angle_at(self, t_s: np.ndarray) -> np.ndarray:
        """Return θ [rad] at times `t_s` (n, m), (n, m)."""
        angle = np.zeros_like(t_s)
        start, v, a = (state[..., None] for state in self._piece_states())
        length, jerk = self.durations_s[..., None], self.jerks_rad_s3[..., None]
        for k in range(2 * PIECES):
            tau = np.clip(t_s - start[:, k], 0.0, length[:, k])
            angle += ((jerk[:, k] / 6 * tau + a[:, k] / 2) * tau + v[:, k]) * tau
        return angle

    def radius_at(self, t_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return r [m] and dr/dt [m/s] at times `t_s` (n, m), each (n, m).

        A cubic spline through (0, r₀), (turn, r₁), (end, r₂) with zero slope at both ends.
        """
        r1, r2 = self.actions[:, 1], self.actions[:, 3]
        turn, end = self.turn_s, self.end_s
        first, second = turn, end - turn
        slope = 1.5 * ((r1 - self.r0_m) / first**2 + (r2 - r1) / second**2)
        slope /= 1 / first + 1 / second
        before = t_s < turn[:, None]
        length = np.where(before, first[:, None], second[:, None])
        s = np.where(before, t_s, np.minimum(t_s, end[:, None]) - turn[:, None]) / length
        low = np.where(before, self.r0_m, r1[:, None])
        high = np.where(before, r1[:, None], r2[:, None])
        slope_low = np.where(before, 0.0, slope[:, None]) * length
        slope_high = np.where(before, slope[:, None], 0.0) * length
        c2 = 3 * (high - low) - 2 * slope_low - slope_high
        c3 = 2 * (low - high) + slope_low + slope_high
        radius = ((c3 * s + c2) * s + slope_low) * s + low
        rate = ((3 * c3 * s + 2 * c2) * s + slope_low) / length
        return radius, np.where(t_s < end[:, None], rate, 0.0)

    def poses_at(self, t_s: np.ndarray) -> np.ndarray:
        """Return x [m], y [m] and yaw [rad] of all casts at times `t_s` (m,) as (n, m, 3)."""
        first, member = distinct_arcs(self.actions)
        arcs = self.rows(first)
        times = np.broadcast_to(t_s, (len(first), len(t_s)))
        angle = arcs.angle_at(times)
        radius, _ = arcs.radius_at(times)
        turn, end = arcs.turn_s[:, None], arcs.end_s[:, None]
        blend = smooth_step((times - turn) / (end - turn))
        path = np.stack([radius * np.cos(angle), radius * np.sin(angle), angle], axis=-1)
        poses = path[member]
        poses[..., 2] += self.actions[:, 4, None] * blend[member]
        return poses

    def peak_speeds(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the largest angular rate [rad/s] and tool speed [m/s] of both arcs, (n, 2)."""
        start, v, a = (state[..., None] for state in self._piece_states())
        tau = self.durations_s[..., None] * np.linspace(0.0, 1.0, SAMPLES_PER_PIECE)
        rate = (self.jerks_rad_s3[..., None] / 2 * tau + a) * tau + v
        n = len(rate)
        radius, radius_rate = self.radius_at((start + tau).reshape(n, -1))
        speed = np.hypot(radius * rate.reshape(n, -1), radius_rate)
        return np.abs(rate).reshape(n, 2, -1).max(axis=2), speed.reshape(n, 2, -1).max(axis=2)


def smooth_step(s: np.ndarray) -> np.ndarray:
    """Return the quintic from 0 to 1 with zero first and second derivatives at both ends."""
    s = np.clip(s, 0.0, 1.0)
    return s**3 * (10 + s * (6 * s - 15))


def distinct_arcs(actions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows of actions (n, 6) that differ in more than α, and each row's member.

    α turns the wrist only: casts that share the rest share the path of the held end.
    """
    without_alpha = np.nan_to_num(actions, nan=-1.0)
    without_alpha[:, 4] = 0.0
    _, first, member = np.unique(without_alpha, axis=0, return_index=True, return_inverse=True)
    return first, member


def plan_curves(actions: np.ndarray, r0_m: float, limits: PlanLimits) -> CastCurves:
    """Plan casts so that the tool's speed peaks at v_max in each arc, or below.

    The limit of the angular velocity of an arc starts at v_max over its radius and is
    corrected until the speed, with the radial part, peaks at v_max; an arc too short to
    reach it is limited by acceleration and jerk alone. Casts that differ in α only share
    one solution. The actions (n, 6), columns `ACTION_COLUMNS`, are not validated here; r₁ is NaN
    where it is to be the spline's value at θ₁.
    """
    first, member = distinct_arcs(actions)
    solved = _solve(actions[first], r0_m, limits).rows(member)
    planned = actions.copy()
    planned[:, 1] = solved.actions[:, 1]
    return CastCurves(planned, r0_m, solved.durations_s, solved.jerks_rad_s3)


def _solve(actions: np.ndarray, r0_m: float, limits: PlanLimits) -> CastCurves:
    free_r1 = np.isnan(actions[:, 1])
    target = actions[:, 5] * (1 - SPEED_MARGIN)
    sign = np.sign(actions[:, 0])
    distances = np.abs(np.stack([actions[:, 0], actions[:, 0] - actions[:, 2]], axis=1))
    radii = np.maximum(r0_m, np.fmax(actions[:, 1], actions[:, 3]))
    limit = np.repeat((target / radii)[:, None], 2, axis=1)
    actions = actions.copy()
    durations, jerks = np.zeros((len(actions), 14)), np.zeros((len(actions), 14))
    open_rows = np.arange(len(actions))
    solver, move, asked = ruckig.Ruckig(1), ruckig.Trajectory(1), ruckig.InputParameter(1)
    asked.max_acceleration = [limits.angular_acceleration_rad_s2]
    asked.max_jerk = [limits.angular_jerk_rad_s3]
    for _ in range(ROUNDS):
        for row in open_rows:
            for arc, direction in ((0, 1.0), (1, -1.0)):
                asked.target_position = [distances[row, arc]]
                asked.max_velocity = [limit[row, arc]]
                result = solver.calculate(asked, move)
                if result not in (ruckig.Result.Working, ruckig.Result.Finished):
                    raise ValueError(f"no jerk-limited move to {actions[row, 0]} rad: {result}")
                profile, piece = move.profiles[0][0], slice(arc * PIECES, (arc + 1) * PIECES)
                durations[row, piece] = profile.t
                jerks[row, piece] = np.multiply(profile.j, direction * sign[row])
        curves = CastCurves(actions, r0_m, durations, jerks).rows(open_rows)
        r1 = np.where(free_r1[open_rows], _spline_r1(curves), actions[open_rows, 1])
        moved = np.nan_to_num(np.abs(r1 - actions[open_rows, 1]), nan=np.inf)
        actions[open_rows, 1] = r1
        curves = CastCurves(actions, r0_m, durations, jerks).rows(open_rows)
        attained, peaks = curves.peak_speeds()
        wanted = target[open_rows, None]
        bound = attained > limit[open_rows] * (1 - 1e-9)
        slow = bound & (peaks < wanted * (1 - SPEED_TOLERANCE))
        fast = peaks > wanted * (1 + SPEED_TOLERANCE)
        limit[open_rows] = np.where(slow | fast, attained * wanted / peaks, limit[open_rows])
        open_rows = open_rows[(slow | fast).any(axis=1) | (moved > 1e-9)]
        if not len(open_rows):
            return CastCurves(actions, r0_m, durations, jerks)
    raise ValueError(
        f"the tool cannot be kept below {actions[open_rows[0], 5]} m/s on the cast "
        f"{np.delete(actions[open_rows[0]], 4).tolist()} (theta1, r1, theta2, r2, vmax)"
    )


def _spline_r1(curves: CastCurves) -> np.ndarray:
    s = curves.turn_s / curves.end_s
    return curves.r0_m + (curves.actions[:, 3] - curves.r0_m) * s * s * (3 - 2 * s)
