"""The camera's pose and lens from the markers in the video's own frames."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import cv2
import numpy as np

from robotcast.vision.camera import Camera
from robotcast.vision.facts import TrackerFacts, TrackingLimits
from robotcast.vision.fiducials import FiducialBoard, find_markers

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
    """A camera as its pictures show it.

    Attributes
    ----------
    reprojection_px : root mean square distance between seen and reprojected marker corners.
    markers : how many markers were seen.
    """

    camera: Camera
    reprojection_px: float
    markers: int

    @property
    def uncertainty_m(self) -> float:
        """What the corners' noise leaves unknown of one coordinate on the board, on average."""
        known = 2 * 4 * self.markers
        per_coordinate_px = self.reprojection_px / np.sqrt(2) * np.sqrt(_FITTED / known)
        return float(per_coordinate_px * self.camera.position_m[2] / self.camera.focal_px)


def calibrate(
    picture: np.ndarray, facts: TrackerFacts, name: str, limits: TrackingLimits = LIMITS
) -> Calibration:
    """Find the camera that sees the markers of `picture` (height, width, 3) where they are.

    One view of a plane cannot tell focal length from height, so the focal length stays at its
    nominal value and the principal point in the middle; pose and distortion take up the rest.

    Parameters
    ----------
    picture : a frame, or the mean of several frames; noise averages out of the corners.
    name : what to call the picture's source in an error.

    Raises ValueError for too few markers, and for markers that do not lie where `facts` says.
    """
    height, width = picture.shape[:2]
    found = find_markers(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), facts.fiducials)
    if len(found) < FEWEST_MARKERS:
        seen = f"only {len(found)}" if found else "no"
        raise ValueError(f"{name}: {seen} fiducials found, at least {FEWEST_MARKERS} are needed")
    corners_px = np.concatenate(list(found.values())).astype(np.float32)
    corners_m = np.concatenate([facts.fiducials.corners_m(i) for i in found])
    points_m = np.column_stack([corners_m, np.zeros(len(corners_m))]).astype(np.float32)
    nominal = Camera.overhead(
        width, height, focal_widths=facts.focal_widths, position_m=(0.0, 0.0, 1.0)
    )
    error_px, _, distortion, rotations, translations = cv2.calibrateCamera(
        [points_m], [corners_px], (width, height), nominal.matrix, np.zeros(5), flags=_FLAGS
    )
    if error_px > limits.reprojection_px:
        raise ValueError(
            f"{name}: the markers lie {error_px:.1f} px from where the session says, more than "
            f"{limits.reprojection_px:g} px; {_misplaced(found, facts.fiducials)}"
        )
    camera = replace(
        nominal,
        distortion=tuple(float(d) for d in distortion.ravel()),
        rotation=tuple(float(r) for r in rotations[0].ravel()),
        translation_m=tuple(float(t) for t in translations[0].ravel()),
    )
    return Calibration(camera, float(error_px), len(found))


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
    nearest = apart_m.argmin(axis=1)
    off = [i for i in range(len(numbers)) if apart_m[i, i] > board.side_m / 4]
    swapped = {
        (min(i, j), max(i, j)) for i in off for j in [int(nearest[i])] if j != i and nearest[j] == i
    }
    said = [f"{numbers[i]} and {numbers[j]} lie in each other's place" for i, j in sorted(swapped)]
    alone = [i for i in off if not any(i in pair for pair in swapped)]
    said += [f"{numbers[i]} lies {apart_m[i, i]:.2f} m from its place" for i in alone]
    return f"of the markers, {', '.join(said)}" if said else "measure their places again"
