import numpy as np
import pytest

from robotcast.vision.tracker import frame_noise, track_cast, track_rest, waypoints_at


def swing(t: np.ndarray) -> np.ndarray:
    """Swing back and forth at up to 5 m/s, resting at both ends."""
    phase = np.clip(t / 0.36, 0, 1)
    angle = 1.45 * np.sin(np.pi * phase) ** 2
    return np.column_stack([0.55 + 0.65 * np.cos(angle), 0.65 * np.sin(angle)])


@pytest.fixture(scope="module")
def swung(lab, tmp_path_factory):
    return lab.film(tmp_path_factory.mktemp("swing"), lab.scene(swing))


def misses_mm(tracked, path) -> np.ndarray:
    return 1e3 * np.linalg.norm(tracked.xy_m - path(tracked.t_s), axis=1)


def test_the_free_end_is_tracked_to_a_millimetre(lab, swung):
    tracked = track_cast(swung, lab.session())
    np.testing.assert_allclose(tracked.t_s, [0.0, 0.1, 0.2, 0.3, 0.4], atol=1e-12)
    assert misses_mm(tracked, swing).max() < 2.0
    assert tracked.hidden == 0 and tracked.gaps == 0


@pytest.mark.slow
def test_at_full_hd_the_free_end_is_tracked_to_half_a_millimetre(full_hd_lab, tmp_path):
    folder = full_hd_lab.film(tmp_path, full_hd_lab.scene(swing))
    assert misses_mm(track_cast(folder, full_hd_lab.session()), swing).max() < 0.8


def test_a_streak_is_stamped_with_the_middle_of_its_exposure(lab, tmp_path):
    speed = 5.0

    def flight(t: np.ndarray) -> np.ndarray:
        return np.column_stack([np.full(len(t), 1.15), -1.0 + speed * np.clip(t, 0, 0.4)])

    tracked = track_cast(lab.film(tmp_path, lab.scene(flight)), lab.session())
    moving = (tracked.t_s > 0.05) & (tracked.t_s < 0.35)
    late_s = (flight(tracked.t_s) - tracked.xy_m)[moving, 1] / speed
    assert np.abs(late_s).max() < 0.0003


def test_behind_the_arm_there_is_a_gap_and_never_a_guess(lab, tmp_path):
    def under(t: np.ndarray) -> np.ndarray:
        y = np.interp(t, [0.05, 0.55], [0.45, -0.35])
        return np.column_stack([np.full(len(t), 0.4), y])

    scene = lab.scene(under, until_s=0.75)
    tracked = track_cast(lab.film(tmp_path, scene), lab.session())
    assert 1 <= tracked.gaps <= 4
    assert tracked.hidden >= 5
    assert misses_mm(tracked, under).max() < 2.5
    assert tracked.t_s[-1] == pytest.approx(0.7)


def test_an_end_that_rests_behind_the_arm_is_lost(lab, tmp_path):
    def hide(t: np.ndarray) -> np.ndarray:
        return np.column_stack([np.full(len(t), 0.4), np.interp(t, [0, 0.3], [0.45, 0.06])])

    folder = lab.film(tmp_path, lab.scene(hide))
    with pytest.raises(ValueError, match="out of sight where it came to rest"):
        track_cast(folder, lab.session())


def test_a_video_without_endpoint_says_so(lab, tmp_path):
    folder = lab.film(tmp_path, lab.scene(lambda t: np.tile([0.0, 2.5], (len(t), 1)), until_s=0.1))
    with pytest.raises(ValueError, match=r"video.mp4: no endpoint found in any of \d+ frames"):
        track_cast(folder, lab.session())


def test_the_resting_end_is_found_in_a_few_frames(lab, tmp_path):
    scene = lab.scene(lambda t: np.tile([1.3, -0.9], (len(t), 1)), until_s=0.05)
    rest = track_rest(lab.film(tmp_path, scene), lab.session())
    assert np.linalg.norm(rest - [1.3, -0.9]) < 0.0015


def test_waypoints_need_both_neighbouring_frames():
    t_s = np.arange(6) / 60
    xy_m = np.column_stack([t_s, 2 * t_s])
    xy_m[3] = np.nan
    found = waypoints_at((np.array([0.5, 1.5, 2.5, 3.5, 4.5, 5.5])) / 60, t_s, xy_m)
    np.testing.assert_array_equal(np.isnan(found[:, 0]), [0, 0, 1, 1, 0, 1])
    np.testing.assert_allclose(found[[0, 1, 4], 0], np.array([0.5, 1.5, 4.5]) / 60)


def test_waypoints_between_frames_follow_a_turn():
    t_s = np.arange(10) / 60
    turn = np.column_stack([t_s, 40 * (t_s - 0.08) ** 2])
    wanted = np.array([4.5]) / 60
    found = waypoints_at(wanted, t_s, turn)
    np.testing.assert_allclose(found[0, 1], 40 * (wanted[0] - 0.08) ** 2, atol=1e-12)


def test_frame_noise_recovers_known_noise():
    t_s = np.arange(400) / 60
    smooth = np.column_stack([np.cos(3 * t_s), np.sin(3 * t_s)])
    noisy = smooth + 3e-4 * np.random.default_rng(0).standard_normal(smooth.shape)
    assert frame_noise(noisy) == pytest.approx(3e-4, rel=0.1)
