"""Cable, bright end and arm during one exposure, ready to be drawn instant by instant."""

from dataclasses import dataclass

import cv2
import numpy as np

from robotcast.vision.camera import Camera

Colour = tuple[float, float, float]

DRAWN_RADII_M = np.array([0.075, 0.06, 0.06, 0.06, 0.05, 0.045, 0.045, 0.045, 0.05, 0.012])
"""How thick the arm's `LINKS` are in pictures."""

_LINK_BGR, _LINK_RIM_BGR = (140.0, 139.0, 137.0), (96.0, 95.0, 94.0)
_LINK_CORE = 0.7
_CABLE_RIM, _CABLE_CORE = 0.75, 0.6
_BALL_RIM = 0.88
_CAP_POINTS = 9
_MARGIN_PX = 4
_SHIFT = 4


@dataclass(frozen=True)
class Shot:
    """What moves, at the n instants of one exposure, in pixels of the box that holds it all.

    Attributes
    ----------
    box : rows and columns of the image.
    cable_px : ndarray of shape (n, m, 2), from the held end to the free end.
    ball_px, ball_axes_px : ndarrays of shapes (n, 2) and (n, 2, 2), the ball's silhouette: an
        ellipse's middle and its half-axes as columns.
    arm_px : ndarray of shape (2, n, links, points, 2), outlines of the links and of their
        brighter cores.
    """

    box: tuple[slice, slice]
    cable_px: np.ndarray
    cable_width_px: float
    ball_px: np.ndarray
    ball_axes_px: np.ndarray
    arm_px: np.ndarray
    arm_moves: bool
    cable_bgr: Colour
    ball_bgr: Colour

    @classmethod
    def of(
        cls,
        cable_m: np.ndarray,
        arm_m: np.ndarray,
        radii_m: tuple[float, float],
        colours_bgr: tuple[Colour, Colour],
        camera: Camera,
        light: np.ndarray,
        *,
        arm_moves: bool,
    ) -> "Shot":
        """Project a cable (n, m, 3) and an arm (n, k, 3) as `camera` sees them.

        Parameters
        ----------
        radii_m, colours_bgr : of the cable and of the ball at its end.
        light : ndarray of shape (height, width), the share of light that reaches each pixel.
        arm_moves : whether the arm must be drawn at every instant.
        """
        cable_px = camera.project(cable_m)
        ball_px, axes = camera.ball_outline(cable_m[:, -1], radii_m[1])
        scale = camera.focal_px / camera.depth(arm_m)
        arm_px = _capsules(camera.project(arm_m), scale)
        everything = np.concatenate([cable_px.reshape(-1, 2), arm_px.reshape(-1, 2)])
        thickness = 2 * radii_m[0] * camera.focal_px / float(camera.depth(cable_m[0, -1]))
        ball_reach = np.abs(axes).sum(axis=-1).max()
        box = _box(everything, max(thickness, ball_reach) + _MARGIN_PX, camera)
        corner = np.array([box[1].start, box[0].start])
        shares = [_light_at(light, px) for px in (cable_px[0, len(cable_px[0]) // 2], ball_px[0])]
        cable_bgr, ball_bgr = (
            (c[0] * s, c[1] * s, c[2] * s) for c, s in zip(colours_bgr, shares, strict=True)
        )
        return cls(
            box,
            cable_px - corner,
            thickness,
            ball_px - corner,
            axes,
            arm_px - corner,
            arm_moves,
            cable_bgr,
            ball_bgr,
        )

    def draw_cable(self, canvas: np.ndarray, instant: int) -> None:
        """Draw the cable, darker at its rims."""
        line = [_fixed(self.cable_px[instant])]
        width = max(round(self.cable_width_px), 1)
        rim = tuple(_CABLE_RIM * c for c in self.cable_bgr)
        cv2.polylines(canvas, line, False, rim, width, cv2.LINE_AA, _SHIFT)
        core = max(round(_CABLE_CORE * self.cable_width_px), 1)
        cv2.polylines(canvas, line, False, self.cable_bgr, core, cv2.LINE_AA, _SHIFT)

    def draw_ball(self, canvas: np.ndarray, instant: int) -> None:
        """Draw the ball, each pixel by its covered share, a little darker at its rim."""
        middle, axes = self.ball_px[instant], self.ball_axes_px[instant]
        reach = np.abs(axes).sum(axis=1) + 1.5
        low = np.maximum(np.floor(middle - reach), 0).astype(int)
        high = np.minimum(np.ceil(middle + reach) + 1, canvas.shape[1::-1]).astype(int)
        if np.any(high <= low):
            return
        u, v = np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]))
        offsets = np.stack([u - middle[0], v - middle[1]], axis=-1)
        out = np.linalg.norm(offsets @ np.linalg.inv(axes).T, axis=-1)[..., None]
        cover = np.clip((1 - out) * np.sqrt(abs(np.linalg.det(axes))) + 0.5, 0, 1)
        shade = 1 - (1 - _BALL_RIM) * np.minimum(out, 1) ** 2
        patch = canvas[low[1] : high[1], low[0] : high[0]]
        patch[:] = np.rint(patch + cover * (shade * np.array(self.ball_bgr) - patch))

    def draw_arm(self, canvas: np.ndarray, instant: int) -> None:
        """Draw the arm's links from the tool up, higher ones over lower ones."""
        for rim, core in zip(*(_fixed(a[instant])[::-1] for a in self.arm_px), strict=True):
            cv2.fillConvexPoly(canvas, rim, _LINK_RIM_BGR, cv2.LINE_AA, _SHIFT)
            cv2.fillConvexPoly(canvas, core, _LINK_BGR, cv2.LINE_AA, _SHIFT)


def _capsules(points_px: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Return outlines of links between points (n, k, 2) seen at `scale` (n, k) [px/m].

    Each outline is the hull of the discs at the link's two ends: of full size in [0], of the
    core's size in [1]; shape (2, n, k − 1, points, 2).
    """
    ends = np.stack([points_px[:, :-1], points_px[:, 1:]], axis=2)
    radii = np.stack([scale[:, :-1], scale[:, 1:]], axis=2) * DRAWN_RADII_M[:, None]
    radii = np.stack([radii, _LINK_CORE * radii])
    along = ends[:, :, 1] - ends[:, :, 0]
    length = np.linalg.norm(along, axis=-1) + 1e-9
    heading = np.arctan2(along[..., 1], along[..., 0])
    tangent = np.arccos(np.clip((radii[..., 0] - radii[..., 1]) / length, -1, 1))[..., None]
    sweep = np.linspace(-1, 1, _CAP_POINTS)
    angles = np.stack([np.pi + sweep * (np.pi - tangent), sweep * tangent], axis=-2)
    angles = angles + heading[..., None, None]
    rays = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    outlines = ends[..., None, :] + radii[..., None, None] * rays
    return outlines.reshape(*outlines.shape[:3], 2 * _CAP_POINTS, 2)


def _box(pixels: np.ndarray, margin: float, camera: Camera) -> tuple[slice, slice]:
    size = np.array([camera.width, camera.height])
    low = np.clip(np.floor(pixels.min(axis=0) - margin), 0, size - 1).astype(int)
    high = np.clip(np.ceil(pixels.max(axis=0) + margin), low + 1, size).astype(int)
    return slice(int(low[1]), int(high[1])), slice(int(low[0]), int(high[0]))


def _light_at(light: np.ndarray, pixel: np.ndarray) -> float:
    u, v = np.clip(np.rint(pixel), 0, np.array(light.shape[::-1]) - 1).astype(int)
    return float(light[v, u])


def _fixed(pixels: np.ndarray) -> np.ndarray:
    """Return pixels as the fixed-point integers that OpenCV draws sub-pixel lines with."""
    return np.rint(pixels * 2**_SHIFT).astype(np.int32)
