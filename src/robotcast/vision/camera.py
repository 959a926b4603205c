"""A pinhole camera with lens distortion over the board."""

from dataclasses import dataclass

import cv2
import numpy as np

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
