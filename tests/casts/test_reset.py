import numpy as np
import pytest

from robotcast.casts.reset import ResetSettings, plan_reset

SETTINGS = ResetSettings()
R0_M = 0.6
LENGTH_M = 0.65
START = np.array([0.7 * np.cos(0.8), -0.7 * np.sin(0.8), 0.4])


def reset(start=START, length_m=LENGTH_M):
    return plan_reset(start, length_m, r0_m=R0_M, settings=SETTINGS)


MOTION = reset()


LIFT = MOTION.t_s <= SETTINGS.lift_s
HUNG_S = SETTINGS.lift_s + SETTINGS.raise_s + SETTINGS.hang_s
HANG = (MOTION.t_s >= HUNG_S - SETTINGS.hang_s) & (MOTION.t_s <= HUNG_S)
PULL = MOTION.t_s >= MOTION.t_s[-1] - SETTINGS.pull_s - SETTINGS.rest_s


def test_it_begins_where_the_cast_ended_and_ends_at_r0_on_the_axis():
    np.testing.assert_allclose(MOTION.position_m[0], [*START[:2], 0.02], atol=1e-12)
    assert MOTION.yaw_rad[0] == START[2]
    np.testing.assert_allclose(MOTION.position_m[-1], [R0_M, 0, 0.02], atol=1e-12)
    assert (MOTION.yaw_rad[-1], MOTION.pitch_rad[-1]) == pytest.approx((0, 0), abs=1e-12)


def test_it_takes_about_20_s_and_hangs_still_for_3():
    assert MOTION.t_s[-1] == pytest.approx(20, abs=1)
    assert np.ptp(MOTION.t_s[HANG]) == pytest.approx(3, abs=0.02)
    assert np.ptp(MOTION.position_m[HANG], axis=0).max() < 1e-12


def test_the_free_end_touches_during_the_lift_and_is_just_above_while_it_hangs():
    assert MOTION.position_m[LIFT, 2].max() < 0.85 * LENGTH_M
    hang_m = MOTION.position_m[HANG, 2][0]
    below_m = hang_m - (LENGTH_M - SETTINGS.loop_m)
    assert 0 < below_m < 0.05


def test_it_lays_the_cable_far_away_and_pulls_it_back_along_the_axis():
    x, y, z = MOTION.position_m[PULL].T
    assert x[0] == pytest.approx(SETTINGS.land_x_m)
    assert np.all(np.diff(x) <= 1e-12)
    assert np.all(np.abs(y) < 1e-12)
    np.testing.assert_allclose(z, 0.02, atol=1e-12)
    assert np.abs(np.diff(x)).max() / SETTINGS.period_s < 0.1


def test_the_motion_is_smooth():
    velocity = np.diff(MOTION.position_m, axis=0) / SETTINGS.period_s
    acceleration = np.diff(velocity, axis=0) / SETTINGS.period_s
    assert np.abs(velocity).max() < 2.0
    assert np.abs(acceleration).max() < 15.0


def test_a_mirrored_start_gives_the_mirrored_motion():
    image = reset(START * np.array([1, -1, -1]))
    np.testing.assert_array_equal(image.position_m, MOTION.position_m * np.array([1, -1, 1]))
    np.testing.assert_array_equal(image.yaw_rad, -MOTION.yaw_rad)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: reset(length_m=65.0), r"cable_length_m must be in \[0.13, 1\] m, got 65"),
        (lambda: reset(start=np.array([0.6, np.nan, 0.0])), "all finite"),
        (lambda: ResetSettings(hang_s=-1), "hang_s must be zero or positive, got -1"),
        (lambda: ResetSettings(back_x_m=0.6), "back_x_m ≤ hang_x_m < land_x_m"),
        (lambda: ResetSettings(drag_fraction=1.0), r"drag_fraction must be in \(0, 1\)"),
    ],
)
def test_bad_numbers_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()
