import numpy as np
import pytest

from robotcast.vision.detector import EndpointFilter
from tests.rigs.small_rig import RIG

BALL_BGR, BOARD_BGR = RIG.tracker.endpoint_bgr, RIG.tracker.board_bgr


def pixels(*colours) -> np.ndarray:
    return np.array([colours], dtype=np.uint8)


def test_board_and_greys_are_nothing_and_the_endpoint_is_one():
    cover = EndpointFilter(BALL_BGR, BOARD_BGR).cover(
        pixels(BOARD_BGR, (0, 0, 0), (128, 128, 128), (255, 255, 255), BALL_BGR)
    )
    np.testing.assert_allclose(cover[0], [0, 0, 0, 0, 1], atol=0.02)


def test_a_half_covered_pixel_is_half_whatever_lies_behind():
    half_board = (np.array(BALL_BGR) + BOARD_BGR) / 2
    half_grey = (np.array(BALL_BGR) + 90.0) / 2
    cover = EndpointFilter(BALL_BGR, BOARD_BGR).cover(pixels(half_board, half_grey))
    np.testing.assert_allclose(cover[0], 0.5, atol=0.02)


def test_an_endpoint_of_the_boards_colour_is_refused():
    with pytest.raises(ValueError, match="cannot be told"):
        EndpointFilter((140.0, 80.0, 33.0), BOARD_BGR)
