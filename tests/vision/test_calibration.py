import numpy as np
import pytest

from robotcast.rigs.virtual.picture import frames
from robotcast.vision.calibration import calibrate


def first_frame(lab) -> np.ndarray:
    scene = lab.scene(lambda t: np.tile([1.2, 0.0], (len(t), 1)))
    return next(frames(scene, lab.camera, lab.picture, 0)).copy()


def board_points(height_m: float) -> np.ndarray:
    x, y = np.meshgrid(np.linspace(0.05, 1.5, 12), np.linspace(-1.2, 1.2, 20))
    return np.column_stack([x.ravel(), y.ravel(), np.full(x.size, height_m)])


@pytest.mark.parametrize(("which", "worst_mm"), [("lab", 1.5), ("full_hd_lab", 0.5)])
def test_the_board_is_where_the_markers_say(which, worst_mm, request):
    lab = request.getfixturevalue(which)
    calibration = calibrate(first_frame(lab), lab.facts, "picture")
    points = board_points(0.015)
    found = calibration.camera.to_plane(lab.camera.project(points), 0.015)
    misses_mm = 1e3 * np.linalg.norm(found - points[:, :2], axis=1)
    assert misses_mm.max() < worst_mm
    assert 0.2 < misses_mm.mean() / (1.5e3 * calibration.uncertainty_m) < 3
    assert calibration.reprojection_px < 0.6


def test_the_height_of_the_ball_shifts_what_is_seen(lab):
    calibration = calibrate(first_frame(lab), lab.facts, "picture")
    points = board_points(0.015)
    ignored = calibration.camera.to_plane(lab.camera.project(points), 0.0)
    away = np.linalg.norm(points[:, :2] - lab.camera.position_m[:2], axis=1)
    shift = np.linalg.norm(ignored - points[:, :2], axis=1)
    far = away > 0.8
    np.testing.assert_allclose(shift[far], away[far] * 0.015 / 2.185, rtol=0.25)
