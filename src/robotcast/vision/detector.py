"""Finding the endpoint in one frame after another."""

from dataclasses import dataclass

import cv2
import numpy as np

from robotcast.vision.camera import Camera
from robotcast.vision.endpoint_filter import EndpointFilter, light_at
from robotcast.vision.facts import TrackerFacts

_COVERED = 0.3
_SMALLEST_SHARE = 0.25
_COARSE = 2
_SEARCH_M = 0.1
_SPREAD_PX = 3
_SPARSE = 8  # pixels of the picture that tell how bright it is beside the first
_FLICKER = 0.02  # a smaller change of brightness is noise


@dataclass(frozen=True)
class Detection:
    """A bright blob in one frame.

    Attributes
    ----------
    xy_m : (2,), where the ball's centre is if the blob is all of it.
    area : the blob's covered area over that of the whole ball seen there, before the endpoint's
        true brightness is known.
    """

    xy_m: np.ndarray
    area: float


class EndpointDetector:
    """Looks near the place where the endpoint should be, over the whole frame when it is lost."""

    def __init__(self, camera: Camera, facts: TrackerFacts, first: np.ndarray) -> None:
        """Take the light's fall-off from the picture `first` (height, width, 3)."""
        self._camera, self._facts = camera, facts
        self._filter = EndpointFilter(facts.endpoint_bgr, facts.board_bgr)
        self._light = self._filter.light(first)
        self._first = first[::_SPARSE, ::_SPARSE].astype(np.float32) + 1
        self._gain = 1.0
        self._seen: list[np.ndarray] = []

    def detect(self, frame: np.ndarray) -> Detection | None:
        """Return the largest endpoint-coloured blob of the next frame, None without one."""
        gain = float(np.median((frame[::_SPARSE, ::_SPARSE] + 1.0) / self._first))
        self._gain = gain if abs(gain - 1) > _FLICKER else 1.0
        expected = self._expected_pixel()
        found = None if expected is None else self._measure(frame, expected)
        if found is None:
            place = self._search(frame)
            found = None if place is None else self._measure(frame, place)
        if found is None:
            self._seen.clear()
            return None
        pixel, area = found
        self._seen = [*self._seen[-1:], pixel]
        return Detection(self._camera.to_plane(pixel, self._facts.endpoint_height_m), area)

    def _expected_pixel(self) -> np.ndarray | None:
        if not self._seen:
            return None
        return 2 * self._seen[-1] - self._seen[0]

    def _search(self, frame: np.ndarray) -> np.ndarray | None:
        coarse = cv2.resize(
            frame, None, fx=1 / _COARSE, fy=1 / _COARSE, interpolation=cv2.INTER_AREA
        )
        blob = _largest_blob(self._filter.cover(coarse) / self._gain)
        if blob is None:
            return None
        return (blob.reshape(-1, 2).mean(axis=0) + 0.5) * _COARSE - 0.5

    def _measure(self, frame: np.ndarray, near: np.ndarray) -> tuple[np.ndarray, float] | None:
        """Return the centroid (2,) [px] and relative area of the blob near a pixel (2,)."""
        camera = self._camera
        reach = _SEARCH_M * camera.focal_px / camera.position_m[2]
        size = np.array([camera.width, camera.height])
        low = np.clip(np.floor(near - reach), 0, size - 1).astype(int)
        high = np.clip(np.ceil(near + reach), low + 1, size).astype(int)
        cover = self._filter.cover(frame[low[1] : high[1], low[0] : high[0]]) / self._gain
        blob = _largest_blob(cover)
        if blob is None or _cut_by_border(blob, cover.shape):
            return None
        mask = np.zeros(cover.shape, np.uint8)
        cv2.drawContours(mask, [blob], -1, 1.0, cv2.FILLED)
        cv2.dilate(mask, np.ones((2 * _SPREAD_PX + 1,) * 2, np.uint8), mask)
        moments = cv2.moments(cover * mask)
        mass = moments["m00"]
        if mass <= 0:
            return None
        centroid = low + np.array([moments["m10"], moments["m01"]]) / mass
        area = mass / light_at(self._light, centroid, frame.shape) / self._whole_area(centroid)
        return (centroid, area) if area > _SMALLEST_SHARE else None

    def _whole_area(self, pixel: np.ndarray) -> float:
        """Return the area [px²] of the whole ball seen at a pixel (2,)."""
        facts = self._facts
        xy = self._camera.to_plane(pixel, facts.endpoint_height_m)
        centre = np.append(xy, facts.endpoint_height_m)
        _, axes = self._camera.ball_outline(centre, facts.endpoint_radius_m)
        return float(np.pi * abs(np.linalg.det(axes)))


def _largest_blob(cover: np.ndarray) -> np.ndarray | None:
    """Return the contour (n, 1, 2) of the largest covered blob, None without one."""
    mask = (cover > _COVERED).astype(np.uint8)
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return max(contours, key=len, default=None)


def _cut_by_border(blob: np.ndarray, shape: tuple[int, ...]) -> bool:
    """Tell whether a blob comes so near its picture's border that part of it may lie beyond."""
    low = blob.reshape(-1, 2).min(axis=0)
    high = blob.reshape(-1, 2).max(axis=0)
    return bool(np.any(low < _SPREAD_PX) or np.any(high >= np.array(shape[1::-1]) - _SPREAD_PX))
