import numpy as np
import pytest

from robotcast.casts.action import Action
from robotcast.casts.curves import plan_curves, smooth_step
from robotcast.casts.plan import PlanLimits, plan_action, plan_actions
from tests.good_casts import mirrored_tool, plan_cast

LIMITS = PlanLimits()
R0_M = 0.6
USUAL = dict(theta1_rad=0.8, theta2_rad=-0.7, r2_m=0.75, alpha_rad=0.6, vmax_m_s=1.6)


def random_actions(n: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    low = np.array([0.2, np.nan, -1.3, 0.52, 0.0, 0.4])
    high = np.array([1.2, np.nan, -0.1, 0.85, 1.3, 2.5])
    return rng.uniform(np.nan_to_num(low), np.nan_to_num(high), (n, 6)) + 0 * low


def test_a_cast_starts_turns_and_ends_where_it_is_told_sampled_every_8_ms():
    cast = plan_cast(**USUAL, r0_m=R0_M, limits=LIMITS)
    turn = cast.tool.at(np.array([cast.turn_s]))[0]
    np.testing.assert_allclose(cast.tool.pose[0], [R0_M, 0, 0], atol=1e-12)
    np.testing.assert_allclose(np.arctan2(turn[1], turn[0]), 0.8, atol=2e-3)
    np.testing.assert_allclose(np.hypot(turn[0], turn[1]), cast.action.r1_m, atol=2e-3)
    end = cast.tool.pose[-1]
    np.testing.assert_allclose(end, [0.75 * np.cos(0.7), -0.75 * np.sin(0.7), -0.1], atol=1e-9)
    np.testing.assert_allclose(np.diff(cast.tool.t_s), 0.008, atol=1e-12)
    assert cast.end_s <= cast.tool.t_s[-1] < cast.end_s + 0.008


def test_the_tool_rests_at_start_turn_and_end():
    curves = plan_curves(random_actions(50), R0_M, LIMITS)
    t_s = np.stack([0 * curves.turn_s, curves.turn_s, curves.end_s], axis=1)
    for near_s in (t_s - 1e-4, t_s + 1e-4):
        np.testing.assert_allclose(curves.angle_at(near_s), curves.angle_at(t_s), atol=1e-10)
    np.testing.assert_allclose(curves.radius_at(t_s)[1][:, [0, 2]], 0.0, atol=1e-12)


def test_speed_never_exceeds_vmax_and_reaches_it_on_a_long_slow_arc():
    curves = plan_curves(random_actions(400), R0_M, LIMITS)
    t_s = np.linspace(0, 1, 3001) * curves.end_s[:, None]
    angle, radius = curves.angle_at(t_s), curves.radius_at(t_s)[0]
    xy = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
    speed = np.linalg.norm(np.diff(xy, axis=1), axis=2) / np.diff(t_s, axis=1)
    assert np.all(speed.max(axis=1) <= curves.actions[:, 5])
    slow = curves.actions[:, 5] < 0.8
    assert np.all(speed[slow].max(axis=1) > 0.999 * curves.actions[slow, 5])


def test_angular_acceleration_and_jerk_stay_within_their_limits():
    curves = plan_curves(random_actions(50), R0_M, LIMITS)
    t_s = np.arange(0, 3, 0.0005)[None].repeat(50, axis=0)
    angle = curves.angle_at(t_s)
    acceleration, jerk = np.diff(angle, 2) / 0.0005**2, np.diff(angle, 3) / 0.0005**3
    assert np.abs(acceleration).max() <= LIMITS.angular_acceleration_rad_s2 * (1 + 1e-6)
    assert np.abs(jerk).max() <= LIMITS.angular_jerk_rad_s3 * (1 + 1e-6)


def test_the_radius_is_smooth_and_passes_through_a_given_r1():
    cast = plan_cast(**USUAL, r0_m=R0_M, r1_m=0.65, limits=LIMITS)
    curves = plan_curves(cast.action.as_array()[None], R0_M, LIMITS)
    around = cast.turn_s + np.array([[-1e-7, 0.0, 1e-7]])
    radius, rate = curves.radius_at(around)
    np.testing.assert_allclose(radius, 0.65, atol=1e-6)
    np.testing.assert_allclose(rate, rate[0, 1], atol=1e-5)


def test_the_filled_in_r1_plans_the_same_cast_again():
    cast = plan_cast(**USUAL, r0_m=R0_M, limits=LIMITS)
    again = plan_action(cast.action, r0_m=R0_M, limits=LIMITS)
    np.testing.assert_allclose(again.tool.pose, cast.tool.pose, atol=1e-6)
    assert again.end_s == pytest.approx(cast.end_s, abs=1e-6)


def test_alpha_turns_the_yaw_only_and_only_in_the_second_arc():
    plain = plan_cast(**USUAL | {"alpha_rad": 0.0}, r0_m=R0_M, limits=LIMITS)
    turned = plan_cast(**USUAL, r0_m=R0_M, limits=LIMITS)
    difference = turned.tool.pose - plain.tool.pose
    assert np.all(difference[:, :2] == 0)
    assert np.all(difference[turned.tool.t_s <= turned.turn_s, 2] == 0)
    assert difference[-1, 2] == pytest.approx(0.6)
    assert np.all(np.diff(difference[:, 2]) >= -1e-12)


def test_the_blend_is_smooth_to_the_second_derivative():
    s = np.array([-1e-3, 0, 1e-3, 1 - 1e-3, 1, 1 + 1e-3])
    np.testing.assert_allclose(smooth_step(s), [0, 0, 0, 1, 1, 1], atol=2e-8)


def test_casts_planned_together_are_those_planned_alone_and_mirror_exactly():
    actions = plan_curves(random_actions(30), R0_M, LIMITS).actions
    together = plan_actions(actions, r0_m=R0_M, limits=LIMITS)
    for row, cast in zip(actions, together, strict=True):
        action = Action.from_array(row)
        alone = plan_action(action, r0_m=R0_M, limits=LIMITS)
        image = plan_action(action.mirrored(), r0_m=R0_M, limits=LIMITS)
        assert np.array_equal(alone.tool.pose, cast.tool.pose)
        assert alone.end_s == cast.end_s
        assert np.array_equal(image.tool.t_s, cast.tool.t_s)
        assert np.array_equal(image.tool.pose, mirrored_tool(cast.tool).pose)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"vmax_m_s": 2.6}, r"vmax must be in \(0, 2.5\] m/s at the tool, got 2.6"),
        ({"vmax_m_s": 0.0}, r"vmax must be in \(0, 2.5\]"),
        ({"theta1_rad": 1.7}, r"\|theta1\| must not exceed 1.5 rad, got 1.7"),
        ({"theta1_rad": 0.0}, "turn back from theta1, got theta1 0 and theta2 -0.7"),
        ({"theta2_rad": 0.9}, "turn back from theta1"),
        ({"r2_m": 0.4}, r"r2 must be in \[0.5, 0.9\] m, got 0.4"),
        ({"r1_m": 750.0}, r"r1 must be in \[0.5, 0.9\] m, got 750"),
        ({"r0_m": 60.0}, r"r0 must be in \[0.5, 0.9\] m, got 60"),
        ({"alpha_rad": 30.0}, r"\|alpha\| must not exceed 3.14159 rad, got 30"),
        ({"r1_m": float("nan")}, "r1 must be a finite number, got nan"),
        ({"theta2_rad": float("inf")}, r"\|theta2\| must not exceed 1.5 rad, got inf"),
    ],
)
def test_bad_numbers_are_refused_with_value_and_limit(change, message):
    with pytest.raises(ValueError, match=message):
        plan_cast(**{"r0_m": R0_M, "limits": LIMITS} | USUAL | change)


def test_limits_must_be_positive():
    with pytest.raises(ValueError, match="angular_jerk_rad_s3 must be positive, got -1"):
        PlanLimits(angular_jerk_rad_s3=-1.0)
