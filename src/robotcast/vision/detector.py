"""Finding the endpoint, told by colour alone, in one frame after another."""

from typing import NamedTuple

import cv2
import numpy as np

from robotcast.vision.camera import Camera, TrackerFacts

_GREY = np.ones(3)
_LEAST_SHARE = 0.15


class EndpointFilter:
    """A linear mix of a pixel's colours: 0 on the board and on anything grey, 1 on the endpoint.

    Being linear, it keeps a pixel's covered share under motion blur, chroma subsampling and the
    codec's smoothing, so that its sum over a streak is the ball's whole area and its centroid
    the ball's place in mid-exposure.
    """

    def __init__(
        self, endpoint_bgr: tuple[float, float, float], board_bgr: tuple[float, float, float]
    ) -> None:
        endpoint, board = np.array(endpoint_bgr), np.array(board_bgr)
        normal = np.cross(_GREY, board)
        share = abs(normal @ endpoint) / (np.linalg.norm(normal) * np.linalg.norm(endpoint) + 1e-9)
        if share < _LEAST_SHARE:
            raise ValueError(
                f"endpoint colour {endpoint_bgr} cannot be told from board {board_bgr} and greys"
            )
        self._weights = (normal / (normal @ endpoint)).astype(np.float32).reshape(1, 3)
        self._board = board

    def cover(self, picture: np.ndarray) -> np.ndarray:
        """Return the covered share of each pixel of (height, width, 3), float32 about 0–1."""
        return cv2.transform(picture.astype(np.float32), self._weights)

    def light(self, picture: np.ndarray) -> np.ndarray:
        """Return (a, b) of the light 1 + a r² + b that the bare board shows, r in image widths.

        Fitted to the board's pixels in a coarse grid; anything of another colour is left out.
        """
        height, width = picture.shape[:2]
        v, u = np.meshgrid(np.arange(4, height, 8), np.arange(4, width, 8), indexing="ij")
        colours = cv2.blur(picture, (5, 5))[v, u].reshape(-1, 3).astype(float)
        level = colours @ self._board / (self._board @ self._board)
        off = np.linalg.norm(colours - level[:, None] * self._board, axis=1)
        bare = off < 0.12 * np.linalg.norm(self._board)
        if bare.sum() < 100:
            return np.zeros(2)
        r2 = _squared_radius(np.stack([u.ravel(), v.ravel()], axis=-1), width, height)
        terms = np.stack([r2[bare], np.ones(bare.sum())], axis=-1)
        return np.linalg.lstsq(terms, level[bare] - 1, rcond=None)[0]


def _squared_radius(pixels: np.ndarray, width: int, height: int) -> np.ndarray:
    centre = np.array([width - 1, height - 1]) / 2
    return np.sum((pixels - centre) ** 2, axis=-1) / width**2


_COVERED = 0.3
_SMALLEST_SHARE = 0.25
_COARSE = 2
_SEARCH_M = 0.1
_SPREAD_PX = 3
_SPARSE = 8  # pixels of the picture that tell how bright it is beside the first
_FLICKER = 0.02  # a smaller change of brightness is noise


class Detection(NamedTuple):
    """A bright blob in one frame."""

    xy_m: np.ndarray  # (2,), where the ball's centre is if the blob is all of it
    area: float  # over the whole ball's there, before the endpoint's true brightness is known


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
        found = self._measure(frame, 2 * self._seen[-1] - self._seen[0]) if self._seen else None
        if found is None and (place := self._search(frame)) is not None:
            found = self._measure(frame, place)
        if found is None:
            self._seen.clear()
            return None
        pixel, area = found
        self._seen = [*self._seen[-1:], pixel]
        return Detection(self._camera.to_plane(pixel, self._facts.endpoint_height_m), area)

    def _search(self, frame: np.ndarray) -> np.ndarray | None:
        scale = 1 / _COARSE
        coarse = cv2.resize(frame, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
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
        fall_off, level = self._light
        light = float(1 + fall_off * _squared_radius(centroid, camera.width, camera.height) + level)
        area = mass / light / self._whole_area(centroid)
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
    x, y, width, height = cv2.boundingRect(blob)
    room = (x, y, shape[1] - x - width, shape[0] - y - height)
    return min(room) < _SPREAD_PX
