"""A board to print, and the camera's focal length from pictures of it held at several tilts.

One view of the flat casting board cannot tell the focal length from the camera's height; views
of a tilted board can (Zhang 2000, "A flexible new technique for camera calibration").
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

COLUMNS, ROWS = 7, 5
DOTS_PER_M = 300 / 0.0254
FEWEST_CORNERS = 12
FEWEST_VIEWS = 6


@dataclass(frozen=True)
class PrintedBoard:
    """A ChArUco board of 7 × 5 squares; A4 holds squares of 35 mm.

    Attributes
    ----------
    square_m : side of a square, as measured on the print.
    """

    square_m: float = 0.035

    def __post_init__(self) -> None:
        if not 0.005 <= self.square_m <= 0.2:
            raise ValueError(f"board: square_m must be in [0.005, 0.2] m, got {self.square_m}")

    def picture(self) -> np.ndarray:
        """Return the board as grey pixels to print at 300 dots an inch."""
        side = round(self.square_m * DOTS_PER_M)
        return self._charuco().generateImage((COLUMNS * side, ROWS * side), marginSize=0)

    def corners(self, picture: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """Return the corners seen, on the board (n, 3) [m] and in the picture (n, 2), or None."""
        grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY) if picture.ndim == 3 else picture
        board = self._charuco()
        pixels, numbers, _, _ = cv2.aruco.CharucoDetector(board).detectBoard(grey)
        if numbers is None or len(numbers) < FEWEST_CORNERS:
            return None
        places = np.asarray(board.getChessboardCorners())[np.ravel(numbers).astype(int)]
        return places.reshape(-1, 3).astype(np.float32), pixels.reshape(-1, 2).astype(np.float32)

    def _charuco(self) -> cv2.aruco.CharucoBoard:
        # another family than the casting board's markers, so that neither is taken for the other
        family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_50)
        return cv2.aruco.CharucoBoard((COLUMNS, ROWS), self.square_m, 0.75 * self.square_m, family)


@dataclass(frozen=True)
class Lens:
    """What pictures of the printed board tell of a lens.

    Attributes
    ----------
    focal_widths : focal length in image widths, as conf/camera wants it.
    spread_widths : its standard deviation.
    reprojection_px : root mean square distance of seen and explained corners.
    """

    focal_widths: float
    spread_widths: float
    reprojection_px: float
    views: int


def calibrate_lens(pictures: Sequence[np.ndarray], board: PrintedBoard) -> Lens:
    """Return the focal length from pictures (height, width, 3) of the board at several tilts."""
    seen = [found for picture in pictures if (found := board.corners(picture)) is not None]
    if len(seen) < FEWEST_VIEWS:
        raise ValueError(
            f"calibration: the printed board is seen in {len(seen)} of {len(pictures)} pictures, "
            f"at least {FEWEST_VIEWS} are needed; hold it still, tilted, and in good light"
        )
    height, width = pictures[0].shape[:2]
    guess = np.array([[width, 0, (width - 1) / 2], [0, width, (height - 1) / 2], [0, 0, 1.0]])
    error_px, matrix, _, _, _, spread, _, _ = cv2.calibrateCameraExtended(
        [places for places, _ in seen],
        [pixels for _, pixels in seen],
        (width, height),
        guess,
        np.zeros(5),
        flags=cv2.CALIB_USE_INTRINSIC_GUESS | cv2.CALIB_FIX_ASPECT_RATIO | cv2.CALIB_FIX_K3,
    )
    focal, deviation = matrix[0, 0] / width, float(np.ravel(spread)[0]) / width
    return Lens(float(focal), deviation, float(error_px), len(seen))
