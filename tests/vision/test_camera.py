import numpy as np
import pytest

from robotcast.vision.camera import Camera


def test_a_projected_point_is_found_again_at_its_height(lab):
    points = np.random.default_rng(0).uniform([0, -1.2, 0.04], [1.5, 1.2, 0.04], (50, 3))
    back = lab.camera.to_plane(lab.camera.project(points), 0.04)
    np.testing.assert_allclose(back, points[:, :2], atol=1e-6)


def test_x_is_up_and_y_left_in_the_image(lab):
    middle, ahead, left = lab.camera.project(
        np.array([[0.8, 0.0, 0.0], [1.0, 0.0, 0.0], [0.8, 0.2, 0.0]])
    )
    assert ahead[1] < middle[1] - 50
    assert left[0] < middle[0] - 50


def test_the_same_camera_at_another_resolution_sees_the_same(lab, full_hd_lab):
    point = np.array([1.1, -0.7, 0.02])
    small, large = lab.camera.project(point), full_hd_lab.camera.project(point)
    np.testing.assert_allclose((large + 0.5) / 2 - 0.5, small, atol=1e-6)


def test_a_ball_off_the_axis_looks_longer_away_from_the_middle(lab):
    _, axes = lab.camera.ball_outline(np.array([0.8, 1.2, 0.015]), 0.015)
    singular = np.linalg.svd(axes, compute_uv=False)
    assert singular[0] / singular[1] == pytest.approx(1.14, abs=0.04)


def test_a_camera_without_size_is_refused():
    with pytest.raises(ValueError, match="must be positive"):
        Camera.overhead(0, 540, focal_widths=0.7, position_m=(0.8, 0.0, 2.0))
