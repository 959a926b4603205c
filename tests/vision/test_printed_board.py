"""A printed board, held at several tilts, tells the focal length."""

import cv2
import numpy as np
import pytest

from robotcast.vision.calibration import COLUMNS, ROWS, SQUARE_M, calibrate_lens, printed_board

WIDTH, HEIGHT, FOCAL = 960, 540, 0.71


def view(tilt: tuple[float, float, float], place_m: tuple[float, float, float]) -> np.ndarray:
    """A picture of the board, turned by `tilt` about its centre, through an ideal lens."""
    printed = printed_board()
    size = np.array([COLUMNS, ROWS]) * SQUARE_M
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)
    points = np.column_stack([(corners - 0.5) * size, np.zeros(4)])
    matrix = np.array(
        [[FOCAL * WIDTH, 0, (WIDTH - 1) / 2], [0, FOCAL * WIDTH, (HEIGHT - 1) / 2], [0, 0, 1]]
    )
    pixels = cv2.projectPoints(points, np.array(tilt), np.array(place_m), matrix, np.zeros(5))[0]
    source = corners * (np.array(printed.shape[::-1]) - 1)
    warp = cv2.getPerspectiveTransform(source.astype(np.float32), pixels[:, 0].astype(np.float32))
    small = cv2.GaussianBlur(printed, (0, 0), 2.0)
    grey = cv2.warpPerspective(small, warp, (WIDTH, HEIGHT), borderValue=(110,))
    return cv2.merge([grey] * 3)


TILTS = ((0.5, 0, 0), (-0.5, 0, 0), (0, 0.5, 0), (0, -0.5, 0), (0.4, 0.4, 0.2), (-0.4, 0.4, -0.2))
VIEWS = [view(tilt, (0.03 * i - 0.08, 0.0, 0.5)) for i, tilt in enumerate(TILTS)]


def test_the_focal_length_is_found():
    lens = calibrate_lens(VIEWS)
    assert lens.focal_widths == pytest.approx(FOCAL, rel=0.01)
    assert 0.0005 < lens.spread_widths < 0.01
    assert lens.views == len(TILTS)
    assert lens.reprojection_px < 0.5


def test_too_few_views_are_refused():
    empty = np.full_like(VIEWS[0], 90)
    with pytest.raises(ValueError, match="seen in 2 of 4 pictures"):
        calibrate_lens([*VIEWS[:2], empty, empty])
