"""The camera's pose and lens from the markers in the video's own frames, and its focal length.

One view of the flat casting board cannot tell the focal length from the camera's height; views of
a printed board, held at several tilts, can (Zhang 2000, "A flexible new technique for camera
calibration").
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from robotcast.vision.camera import (
    Camera,
    FiducialBoard,
    TrackerFacts,
    TrackingLimits,
    find_markers,
)

FEWEST_MARKERS = 4
LIMITS = TrackingLimits()
_FITTED = 10  # three of place, three of direction, four of distortion
_FLAGS = (
    cv2.CALIB_USE_INTRINSIC_GUESS
    | cv2.CALIB_FIX_FOCAL_LENGTH
    | cv2.CALIB_FIX_PRINCIPAL_POINT
    | cv2.CALIB_FIX_K3
)


@dataclass(frozen=True)
class Calibration:
    """A camera as its pictures show it."""

    camera: Camera
    reprojection_px: float  # root mean square distance of seen and reprojected marker corners
    uncertainty_m: float  # what their noise leaves unknown of one coordinate, on average


def calibrate(
    picture: np.ndarray, facts: TrackerFacts, name: str, limits: TrackingLimits = LIMITS
) -> Calibration:
    """Find the camera that sees the markers of `picture` (height, width, 3) where they are.

    One view of a plane cannot tell focal length from height, so the focal length stays at its
    nominal value and the principal point in the middle; pose and distortion take up the rest.
    `picture` is a frame, or the mean of several: noise averages out of the corners.

    Raises ValueError, which calls the picture `name`, for too few markers, and for markers that do
    not lie where `facts` says.
    """
    height, width = picture.shape[:2]
    found = find_markers(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), facts.fiducials)
    if len(found) < FEWEST_MARKERS:
        seen = f"only {len(found)}" if found else "no"
        raise ValueError(f"{name}: {seen} fiducials found, at least {FEWEST_MARKERS} are needed")
    corners_px = np.concatenate(list(found.values())).astype(np.float32)
    corners_m = np.concatenate([facts.fiducials.corners_m(i) for i in found]).astype(np.float32)
    nominal = Camera.overhead(
        width, height, focal_widths=facts.focal_widths, position_m=(0.0, 0.0, 1.0)
    )
    error_px, _, distortion, rotations, translations = cv2.calibrateCamera(
        [corners_m], [corners_px], (width, height), nominal.matrix, np.zeros(5), flags=_FLAGS
    )
    if error_px > limits.reprojection_px:
        raise ValueError(
            f"{name}: the markers lie {error_px:.1f} px from where the session says, more than "
            f"{limits.reprojection_px:g} px; {_misplaced(found, facts.fiducials)}"
        )
    camera = replace(
        nominal,
        distortion=tuple(distortion.ravel().tolist()),
        rotation=tuple(rotations[0].ravel().tolist()),
        translation_m=tuple(translations[0].ravel().tolist()),
    )
    per_coordinate_px = error_px / np.sqrt(2) * np.sqrt(_FITTED / (2 * len(corners_px)))
    uncertainty_m = per_coordinate_px * camera.position_m[2] / camera.focal_px
    return Calibration(camera, float(error_px), float(uncertainty_m))


def _misplaced(found: Mapping[int, np.ndarray], board: FiducialBoard) -> str:
    """Say which markers lie elsewhere than most of them say."""
    numbers = list(found)
    seen_px = np.array([found[n].mean(axis=0) for n in numbers])
    places_m = np.array([board.centres_m[n] for n in numbers])
    to_board, _ = cv2.findHomography(seen_px, places_m, cv2.RANSAC, board.side_m / 4)
    if to_board is None:
        return "measure their places again"
    lies_m = cv2.perspectiveTransform(seen_px[None], to_board)[0]
    apart_m = np.linalg.norm(lies_m[:, None] - places_m[None], axis=-1)
    nearest, own = apart_m.argmin(axis=1), np.arange(len(numbers))
    off = np.diag(apart_m) > board.side_m / 4
    swapped = off & (nearest != own) & (nearest[nearest] == own)
    pairs = {(min(i, nearest[i]), max(i, nearest[i])) for i in own[swapped]}
    said = [f"{numbers[i]} and {numbers[j]} lie in each other's place" for i, j in sorted(pairs)]
    alone = own[off & ~swapped]
    said += [f"{numbers[i]} lies {apart_m[i, i]:.2f} m from its place" for i in alone]
    return f"of the markers, {', '.join(said)}" if said else "measure their places again"


COLUMNS, ROWS, SQUARE_M = 7, 5, 0.035  # of the printed board
DOTS_PER_M = 300 / 0.0254
FEWEST_CORNERS = 12
FEWEST_VIEWS = 6


def _charuco() -> cv2.aruco.CharucoBoard:
    # another family than the casting board's markers, so that neither is taken for the other
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_50)
    return cv2.aruco.CharucoBoard((COLUMNS, ROWS), SQUARE_M, 0.75 * SQUARE_M, family)


def printed_board() -> np.ndarray:
    """Return a ChArUco board that A4 holds, as grey pixels to print at 300 dots an inch."""
    side = round(SQUARE_M * DOTS_PER_M)
    return _charuco().generateImage((COLUMNS * side, ROWS * side), marginSize=0)


def board_corners(picture: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the printed board's corners seen in a picture (height, width, 3), or None.

    They are given on the board, (n, 3) [m], and in the picture, (n, 2).
    """
    board = _charuco()
    grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    pixels, numbers, _, _ = cv2.aruco.CharucoDetector(board).detectBoard(grey)
    if numbers is None or len(numbers) < FEWEST_CORNERS:
        return None
    places = np.asarray(board.getChessboardCorners())[np.ravel(numbers).astype(int)]
    return places.reshape(-1, 3).astype(np.float32), pixels.reshape(-1, 2).astype(np.float32)


@dataclass(frozen=True)
class Lens:
    """What pictures of the printed board tell of a lens."""

    focal_widths: float  # focal length in image widths, as conf/camera wants it
    spread_widths: float  # its standard deviation
    reprojection_px: float  # root mean square distance of seen and explained corners
    views: int


def calibrate_lens(pictures: Sequence[np.ndarray]) -> Lens:
    """Return the focal length from pictures of the printed board, (height, width, 3), tilted."""
    seen = [found for picture in pictures if (found := board_corners(picture)) is not None]
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
    deviation_px = float(np.ravel(spread)[1])  # OpenCV gives it for f_y alone, which f_x follows
    return Lens(float(matrix[0, 0] / width), deviation_px / width, float(error_px), len(seen))
