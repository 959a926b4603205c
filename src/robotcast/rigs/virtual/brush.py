"""Drawing the cable, its bright end and the arm at one instant, in part of an image."""

import cv2
import numpy as np

from robotcast.rigs.envelope import LINK_RADII_M
from robotcast.vision.camera import Camera

Box = tuple[slice, slice]

ARM_RADII_M = tuple(LINK_RADII_M.values())
_LINK_BGR, _RIM_BGR = (140.0, 139.0, 137.0), (96.0, 95.0, 94.0)
_RIM_SHADE = 0.75
_BALL_SHADE = 0.12
_SHIFT = 4


def surrounding_box(cable_px: np.ndarray, arm_m: np.ndarray, camera: Camera) -> Box:
    """Return rows and columns that hold cable pixels (…, 2) and arm points (…, 3), thickness too."""
    depth = float(np.min(camera.depth(arm_m)))
    points = np.concatenate([cable_px.reshape(-1, 2), camera.project(arm_m).reshape(-1, 2)])
    margin = 1.3 * max(ARM_RADII_M) * camera.focal_px / depth + 3
    size = np.array([camera.width, camera.height])
    low = np.clip(np.floor(points.min(axis=0) - margin), 0, size - 1).astype(int)
    high = np.clip(np.ceil(points.max(axis=0) + margin), low + 1, size).astype(int)
    return slice(int(low[1]), int(high[1])), slice(int(low[0]), int(high[0]))


def draw_cable(
    canvas: np.ndarray,
    box: Box,
    cable_px: np.ndarray,
    width_px: float,
    colour: tuple[float, float, float],
) -> None:
    """Draw the cable through pixels (m, 2), darker at its rims."""
    line = [_fixed(cable_px - _corner(box))]
    thickness = max(round(width_px), 1)
    rim = tuple(_RIM_SHADE * c for c in colour)
    cv2.polylines(canvas, line, False, rim, thickness, cv2.LINE_AA, _SHIFT)
    if thickness > 3:
        cv2.polylines(canvas, line, False, colour, round(0.6 * thickness), cv2.LINE_AA, _SHIFT)


def draw_ball(
    canvas: np.ndarray,
    box: Box,
    centre_m: np.ndarray,
    radius_m: float,
    camera: Camera,
    colour: tuple[float, float, float],
) -> None:
    """Draw a ball's silhouette, an ellipse off the image's middle, each pixel by its cover."""
    middle, axes = camera.ball_outline(centre_m, radius_m)
    middle = middle - _corner(box)
    reach = np.abs(axes).sum(axis=1) + 1.5
    low = np.maximum(np.floor(middle - reach), 0).astype(int)
    high = np.minimum(np.ceil(middle + reach) + 1, canvas.shape[1::-1]).astype(int)
    if np.any(high <= low):
        return
    u, v = np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]))
    offsets = np.stack([u - middle[0], v - middle[1]], axis=-1)
    out = np.linalg.norm(offsets @ np.linalg.inv(axes).T, axis=-1)
    size = np.sqrt(abs(np.linalg.det(axes)))
    cover = np.clip((1 - out) * size + 0.5, 0, 1)[..., None]
    shade = 1 - _BALL_SHADE * np.minimum(out, 1)[..., None] ** 2
    patch = canvas[low[1] : high[1], low[0] : high[0]]
    patch[:] = np.rint((1 - cover) * patch + cover * shade * np.array(colour))


def draw_arm(canvas: np.ndarray, box: Box, points_m: np.ndarray, camera: Camera) -> None:
    """Draw the arm's links between points (k, 3) as capsules, the tool first, higher ones over."""
    middles = camera.project(points_m) - _corner(box)
    scale = camera.focal_px / camera.depth(points_m)
    for link in range(len(points_m) - 2, -1, -1):
        ends, radii = middles[link : link + 2], ARM_RADII_M[link] * scale[link : link + 2]
        _draw_capsule(canvas, ends, radii, _RIM_BGR)
        _draw_capsule(canvas, ends, 0.7 * radii, _LINK_BGR)


def _draw_capsule(
    canvas: np.ndarray, ends: np.ndarray, radii: np.ndarray, colour: tuple[float, float, float]
) -> None:
    along = ends[1] - ends[0]
    length = np.linalg.norm(along)
    if length > 0.5:
        side = np.array([-along[1], along[0]]) / length
        outline = ends[[0, 1, 1, 0]] + np.outer(radii[[0, 1, 1, 0]] * [1, 1, -1, -1], side)
        cv2.fillConvexPoly(canvas, _fixed(outline), colour, cv2.LINE_AA, _SHIFT)
    for (u, v), radius in zip(_fixed(ends), _fixed(radii), strict=True):
        cv2.circle(canvas, (int(u), int(v)), int(radius), colour, -1, cv2.LINE_AA, _SHIFT)


def _corner(box: Box) -> np.ndarray:
    return np.array([box[1].start, box[0].start])


def _fixed(pixels: np.ndarray) -> np.ndarray:
    """Return pixels as the fixed-point integers that OpenCV draws sub-pixel lines with."""
    return np.rint(pixels * 2**_SHIFT).astype(np.int32)
