"""What a session tells its tracker beforehand: colours, sizes, the ArUco markers on the board."""

import json
import math
from dataclasses import asdict, dataclass, fields
from typing import Any

import cv2
import numpy as np

from robotcast.sessions import Session
from robotcast.vision.camera import Camera

BORDER_MODULES = 1
MODULES = 4 + 2 * BORDER_MODULES


@dataclass(frozen=True)
class FiducialBoard:
    """Markers lying on the board, upright towards +x."""

    side_m: float  # of a marker's black square
    centres_m: tuple[tuple[float, float], ...]  # (x, y) in the robot frame, by their numbers

    @classmethod
    def along_edges(
        cls, length_m: float, width_m: float, *, side_m: float, margin_m: float, spacing_m: float
    ) -> "FiducialBoard":
        """Lay markers along the edges of a board x ∈ [0, length], |y| ≤ width / 2.

        The near edge keeps a gap in the middle for the robot's base.
        """
        x_near, x_far = margin_m, length_m - margin_m
        y_edge = width_m / 2 - margin_m
        along_y = np.linspace(-y_edge, y_edge, round(2 * y_edge / spacing_m) + 1)
        along_x = np.linspace(x_near, x_far, round((x_far - x_near) / spacing_m) + 1)
        places = [(x_far, y) for y in along_y]
        places += [(x, y) for y in (-y_edge, y_edge) for x in along_x[:-1]]
        places += [(x_near, y) for y in along_y[1:-1] if abs(y) > spacing_m / 2]
        return cls(side_m, tuple((float(x), float(y)) for x, y in places))

    def corners_m(self, number: int) -> np.ndarray:
        """Return the corners (4, 3) of a marker in OpenCV's order, clockwise from its top left."""
        offsets = np.array([[1, 1, 0], [1, -1, 0], [-1, -1, 0], [-1, 1, 0]]) * self.side_m / 2
        return offsets + np.append(self.centres_m[number], 0.0)


def dictionary() -> cv2.aruco.Dictionary:
    """Return the marker family in use."""
    return cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)


def find_markers(grey: np.ndarray, board: FiducialBoard) -> dict[int, np.ndarray]:
    """Return the sub-pixel corners (4, 2) of each of the board's markers seen in a grey image."""
    settings = cv2.aruco.DetectorParameters()
    settings.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    settings.cornerRefinementWinSize = 3
    settings.minMarkerPerimeterRate = 0.02
    corners, numbers, _ = cv2.aruco.ArucoDetector(dictionary(), settings).detectMarkers(grey)
    if numbers is None:
        return {}
    found = zip(np.ravel(numbers), corners, strict=True)
    return {int(i): c.reshape(4, 2) for i, c in found if i < len(board.centres_m)}


class Stillness:
    """Tells from the markers whether a picture was taken from where the first one was."""

    def __init__(self, first: np.ndarray, camera: Camera, board: FiducialBoard) -> None:
        """Remember every marker of the picture `first` (height, width, 3) with its surroundings."""
        grey = _grey(first)
        self._patches = []
        for number in range(len(board.centres_m)):
            pixels = camera.project(board.corners_m(number))
            reach = np.ptp(pixels, axis=0) / 2
            low, high = pixels.min(axis=0) - reach, pixels.max(axis=0) + reach
            if (low >= 0).all() and (high < grey.shape[::-1]).all():
                rows, columns = (slice(int(low[k]), int(high[k])) for k in (1, 0))
                self._patches.append((rows, columns, grey[rows, columns]))

    def moved_px(self, frame: np.ndarray) -> float:
        """Return by how much the markers are shifted in `frame`; some may be hidden."""
        shifts = [
            math.hypot(*cv2.phaseCorrelate(first, _grey(frame[rows, columns]))[0])
            for rows, columns, first in self._patches
        ]
        return float(np.median(shifts)) if shifts else 0.0


def _grey(picture: np.ndarray) -> np.ndarray:
    return cv2.cvtColor(np.ascontiguousarray(picture), cv2.COLOR_BGR2GRAY).astype(np.float32)


BLOCK = "vision"


@dataclass(frozen=True)
class TrackingLimits:
    """When a film is not believed: the most that markers may be off in its pictures."""

    reprojection_px: float = 1.5  # root mean square, of corners, found to a third of a pixel
    moved_px: float = 1.5  # shifted since the first picture: the camera was moved


@dataclass(frozen=True)
class TrackerFacts:
    """The `vision` block of session.yaml: all that a person can measure or look up."""

    period_s: float  # a waypoint is wanted so often, from t = 0 on
    exposure_s: float  # frame k is exposed from video_t0_s + k / fps on
    focal_widths: float  # the lens's nominal focal length in image widths
    endpoint_radius_m: float  # of the bright round end
    endpoint_height_m: float  # of its centre
    endpoint_bgr: tuple[float, float, float]  # grey levels
    board_bgr: tuple[float, float, float]
    fiducials: FiducialBoard

    @classmethod
    def of(cls, session: Session) -> "TrackerFacts":
        """Read what a session tells its tracker, as `as_dict` wrote it."""
        if BLOCK not in session.facts:
            raise ValueError(f"{session.folder}: session.yaml has no `{BLOCK}` block")
        given = {field.name: session.facts[BLOCK][field.name] for field in fields(cls)}
        board = given.pop("fiducials")
        fiducials = FiducialBoard(float(board["side_m"]), _numbers(board["centres_m"]))
        return cls(**{name: _numbers(value) for name, value in given.items()}, fiducials=fiducials)

    def as_dict(self) -> dict[str, Any]:
        """Return plain numbers and lists for a YAML file."""
        return json.loads(json.dumps(asdict(self)))


def _numbers(value: Any) -> Any:
    return tuple(map(_numbers, value)) if isinstance(value, list) else float(value)
