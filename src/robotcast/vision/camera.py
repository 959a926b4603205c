"""The camera over the board, and what a session tells its tracker of colours, sizes and markers."""

import json
import math
from dataclasses import asdict, dataclass, fields
from typing import Any

import cv2
import numpy as np

from robotcast.sessions import Session

_UNDISTORT_UNTIL = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 40, 1e-9)


@dataclass(frozen=True)
class Camera:
    """Where a camera is, how it is turned, and how its lens bends straight lines."""

    width: int  # of the image [px], as is the height
    height: int
    focal_px: float  # focal length; pixels are square
    centre_px: tuple[float, float]  # principal point (u, v)
    distortion: tuple[float, ...]  # (k1, k2, p1, p2, k3), Brown–Conrady terms in OpenCV's order
    rotation: tuple[float, ...]  # Rodrigues vector (3,) that turns the robot frame to the camera's
    translation_m: tuple[float, ...]  # (3,), so that p_camera = R p + translation

    @classmethod
    def overhead(
        cls,
        width: int,
        height: int,
        *,
        focal_widths: float,
        position_m: tuple[float, float, float],
        tilt_rad: tuple[float, float, float] = (0.0, 0.0, 0.0),
        centre_offset_widths: tuple[float, float] = (0.0, 0.0),
        distortion: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0),
    ) -> "Camera":
        """Hang a camera over the board, looking down, x up and y left in the image.

        Focal length and the principal point's offset from the middle are in image widths, so that
        one description serves every resolution; the position is in the robot frame, the tilts are
        small turns about the image's right, down and viewing axes.
        """
        if width <= 0 or height <= 0 or focal_widths <= 0:
            raise ValueError(
                f"camera: size and focal length must be positive, got {width} × {height} px "
                f"and {focal_widths} widths"
            )
        looking_down = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
        turn = cv2.Rodrigues(np.asarray(tilt_rad, dtype=float))[0] @ looking_down
        right, down = centre_offset_widths
        return cls(
            width,
            height,
            focal_widths * width,
            ((width - 1) / 2 + right * width, (height - 1) / 2 + down * width),
            tuple(map(float, distortion)),
            tuple(cv2.Rodrigues(turn)[0].ravel().tolist()),
            tuple((-turn @ np.asarray(position_m, dtype=float)).tolist()),
        )

    @property
    def matrix(self) -> np.ndarray:
        """The intrinsic matrix (3, 3)."""
        (u, v), f = self.centre_px, self.focal_px
        return np.array([[f, 0.0, u], [0.0, f, v], [0.0, 0.0, 1.0]])

    @property
    def rotation_matrix(self) -> np.ndarray:
        """R (3, 3), from the robot frame to the camera's."""
        return cv2.Rodrigues(np.array(self.rotation))[0]

    @property
    def position_m(self) -> np.ndarray:
        """The camera's position in the robot frame, (3,)."""
        return -self.rotation_matrix.T @ np.array(self.translation_m)

    def project(self, points_m: np.ndarray) -> np.ndarray:
        """Return the pixels (…, 2) of points (…, 3) in the robot frame."""
        points = np.ascontiguousarray(points_m, dtype=float)
        pixels = cv2.projectPoints(
            points.reshape(-1, 1, 3),
            np.array(self.rotation),
            np.array(self.translation_m),
            self.matrix,
            np.array(self.distortion),
        )[0]
        return pixels.reshape(*points.shape[:-1], 2)

    def depth(self, points_m: np.ndarray) -> np.ndarray:
        """Return the distances (…) of points (…, 3) along the viewing axis [m]."""
        return np.asarray(points_m) @ self.rotation_matrix[2] + self.translation_m[2]

    def ball_outline(self, centre_m: np.ndarray, radius_m: float) -> tuple[np.ndarray, np.ndarray]:
        """Return middles (…, 2) and half-axes, columns (…, 2, 2) [px], of balls seen at (…, 3)."""
        sight = self.position_m - centre_m
        distance = np.linalg.norm(sight, axis=-1, keepdims=True)
        sight = sight / distance
        right = np.cross(sight, [1.0, 0.0, 0.0])
        right /= np.linalg.norm(right, axis=-1, keepdims=True)
        nearer = centre_m + sight * radius_m**2 / distance
        rim = radius_m * np.sqrt(1 - (radius_m / distance) ** 2)
        outline = [nearer, nearer + rim * right, nearer + rim * np.cross(sight, right)]
        middle, *ends = self.project(np.stack(outline))
        return middle, np.stack([end - middle for end in ends], axis=-1)

    def to_plane(self, pixels: np.ndarray, height_m: float = 0.0) -> np.ndarray:
        """Return where the rays of `pixels` (…, 2) meet the plane z = `height_m`, (…, 2) [m]."""
        shape = np.shape(pixels)
        rays = cv2.undistortPointsIter(
            np.ascontiguousarray(pixels, dtype=float).reshape(-1, 1, 2),
            self.matrix,
            np.array(self.distortion),
            np.eye(3),
            np.eye(3),
            _UNDISTORT_UNTIL,
        ).reshape(-1, 2)
        directions = np.column_stack([rays, np.ones(len(rays))]) @ self.rotation_matrix
        position = self.position_m
        reach = (height_m - position[2]) / directions[:, 2]
        return (position[:2] + reach[:, None] * directions[:, :2]).reshape(shape)


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
