"""What an overhead webcam sees of a virtual cast, as a video file."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from robotcast.files import atomic_file
from robotcast.sessions import video_writer
from robotcast.vision.camera import BORDER_MODULES, MODULES, Camera, FiducialBoard, dictionary

Colour = tuple[float, float, float]

DRAWN_RADII_M = np.array([0.075, 0.06, 0.06, 0.06, 0.05, 0.045, 0.045, 0.045, 0.05, 0.012])
"""How thick the arm's links are in pictures."""

_BLUR_STEP_PX, _MOST_INSTANTS, _STILL_PX = 2.5, 12, 0.2
_NOISE_SLACK_PX = 64
_NOISE_GREY = 12  # added to the noise and taken off the scene, so that both are unsigned
_LINK_BGR, _LINK_RIM_BGR, _LINK_CORE = (140.0, 139.0, 137.0), (96.0, 95.0, 94.0), 0.7
_CABLE_RIM, _CABLE_CORE, _BALL_RIM = 0.75, 0.6, 0.88
_CAP_POINTS, _MARGIN_PX = 9, 4
_SHIFT = 4  # bits of OpenCV's fixed-point pixels

_FLOOR_BGR, _PAPER_GREY, _INK_GREY = (66.0, 64.0, 62.0), 225.0, 28.0
_TEXEL_M, _FLOOR_M = 0.001, 0.7  # the floor is drawn so far about the board
_OVERSAMPLING, _NODE_EVERY = 2, 8
_BOARD_SEED = 20220411


@dataclass(frozen=True)
class SceneMotion:
    """Everything that moves before the camera, at the increasing times `t_s` (n,) of the video.

    Let them begin two frames or more before t = 0, so that a waypoint at t = 0 has frames on both
    sides; 240 Hz or denser, for motion blur.
    """

    t_s: np.ndarray
    cable_m: np.ndarray  # (n, m, 3), nodes from the held end to the free end's centre
    arm_m: np.ndarray  # (n, 11, 3), the arm's `link_points`
    cable_radius_m: float
    endpoint_radius_m: float


@dataclass(frozen=True)
class PictureSettings:
    """The camera's shutter and sensor, and the colours of what it looks at."""

    fiducials: FiducialBoard
    board_length_m: float
    board_width_m: float
    fps: float  # frame k is exposed from t_s[0] + k / fps on
    exposure_s: float
    noise_grey: float  # standard deviation of the sensor noise [grey levels of 255]
    vignetting: float  # how much darker the image's corners are, 0–1
    board_bgr: Colour
    endpoint_bgr: Colour
    cable_bgr: Colour


def frame_starts(motion: SceneMotion, settings: PictureSettings) -> np.ndarray:
    """Return when each frame's exposure begins, (k,) [s]; the first is `video_t0_s`."""
    span = motion.t_s[-1] - motion.t_s[0] - settings.exposure_s
    return motion.t_s[0] + np.arange(int(span * settings.fps + 1e-9) + 1) / settings.fps


def render_cast(
    path: Path, motion: SceneMotion, camera: Camera, settings: PictureSettings, seed: int
) -> None:
    """Film `motion` with `camera` into the video file `path`; the same seed gives the same file."""
    cv2.setNumThreads(1)
    with atomic_file(path) as temporary:
        writer = video_writer(temporary, settings.fps, camera.width, camera.height)
        try:
            for frame in frames(motion, camera, settings, seed):
                writer.write(frame)
        finally:
            writer.release()


def frames(
    motion: SceneMotion, camera: Camera, settings: PictureSettings, seed: int
) -> Iterator[np.ndarray]:
    """Yield the frames of a cast, uint8 (height, width, 3); each is overwritten by the next.

    What moves is drawn at several instants of an exposure, more the faster its image moves.
    """
    shutter = _Shutter(motion, camera, settings)
    offset = np.full_like(shutter.scene, _NOISE_GREY)
    darker = cv2.subtract(shutter.scene, offset)
    bank = _noise_bank(camera.width, camera.height, settings.noise_grey)
    rng, picture = np.random.default_rng(seed), np.empty_like(shutter.scene)
    moving_m, begins = (motion.cable_m, motion.arm_m), frame_starts(motion, settings)
    travels = []
    for points in moving_m:
        times = begins, begins + settings.exposure_s
        first, last = (camera.project(_at(t_s, motion.t_s, points)) for t_s in times)
        travels.append(np.linalg.norm(last - first, axis=-1).max(axis=-1))
    counts = np.clip(np.ceil(np.maximum(*travels) / _BLUR_STEP_PX), 1, _MOST_INSTANTS).astype(int)
    for begin, count, arm_travel in zip(begins, counts, travels[1], strict=True):
        row, column = rng.integers(0, _NOISE_SLACK_PX, 2)
        noise = bank[row : row + camera.height, column : column + camera.width]
        cv2.add(darker, noise, picture)
        times = begin + (np.arange(count) + 0.5) / count * settings.exposure_s
        cable_m, arm_m = (_at(times, motion.t_s, points) for points in moving_m)
        box, moving = shutter.expose(cable_m, arm_m, arm_moves=bool(arm_travel > _STILL_PX))
        picture[box] = cv2.add(cv2.subtract(moving, offset[box]), noise[box])
        yield picture


class _Shutter:
    """Exposes what moves before the still scene, darker towards the picture's corners."""

    def __init__(self, motion: SceneMotion, camera: Camera, settings: PictureSettings) -> None:
        self.camera = camera
        scene = backdrop(camera, settings)
        self._light = _vignette(camera, settings.vignetting)
        self.scene = cv2.multiply(scene, cv2.merge([self._light] * 3), dtype=cv2.CV_8U)
        self._canvas, self._total = np.empty_like(scene), np.empty(scene.shape, np.float32)
        self._bgr = np.array([settings.cable_bgr, settings.endpoint_bgr])
        self._cable_m, self._ball_m = 2 * motion.cable_radius_m, motion.endpoint_radius_m

    def expose(
        self, cable_m: np.ndarray, arm_m: np.ndarray, *, arm_moves: bool
    ) -> tuple[tuple[slice, slice], np.ndarray]:
        """Return the box, rows and columns, of all that moves in an exposure, and its mean, uint8.

        The cable (n, m, 3) and the arm (n, k, 3) are drawn at n instants, an arm that stands
        still once.
        """
        camera = self.camera
        cable_px = camera.project(cable_m)
        ball_px, axes = camera.ball_outline(cable_m[:, -1], self._ball_m)
        arm_px = _link_outlines(camera.project(arm_m), camera.focal_px / camera.depth(arm_m))
        width = self._cable_m * camera.focal_px / float(camera.depth(cable_m[0, -1]))
        margin = max(width, np.abs(axes).sum(axis=-1).max()) + _MARGIN_PX
        everything = np.concatenate([cable_px.reshape(-1, 2), arm_px.reshape(-1, 2)])
        size = np.array([camera.width, camera.height])
        low = np.clip(np.floor(everything.min(axis=0) - margin), 0, size - 1).astype(int)
        high = np.clip(np.ceil(everything.max(axis=0) + margin), low + 1, size).astype(int)
        box = slice(low[1], high[1]), slice(low[0], high[0])
        lit_px = (cable_px[0, len(cable_px[0]) // 2], ball_px[0])
        u, v = np.clip(np.rint(lit_px), 0, size - 1).astype(int).T
        cable_bgr, ball_bgr = self._bgr * self._light[v, u, None]
        scene, canvas, total = self.scene[box], self._canvas[box], self._total[box]
        total[:] = 0
        for instant in range(len(cable_px)):
            np.copyto(canvas, scene)
            _draw_cable(canvas, cable_px[instant] - low, width, cable_bgr)
            _draw_ball(canvas, ball_px[instant] - low, axes[instant], ball_bgr)
            if arm_moves:
                _draw_arm(canvas, arm_px[:, instant] - low)
            cv2.accumulate(canvas, total)
        mean = cv2.convertScaleAbs(total, alpha=1.0 / len(cable_px))
        if not arm_moves:
            _draw_arm(mean, arm_px[:, 0] - low)
        return box, mean


def _draw_cable(canvas: np.ndarray, line_px: np.ndarray, width: float, bgr: np.ndarray) -> None:
    """Draw the cable (m, 2), darker at its rims."""
    for share, colour in ((1.0, _CABLE_RIM * bgr), (_CABLE_CORE, bgr)):
        thickness, line = max(round(share * width), 1), [_fixed(line_px)]
        cv2.polylines(canvas, line, False, colour.tolist(), thickness, cv2.LINE_AA, _SHIFT)


def _draw_ball(canvas: np.ndarray, middle: np.ndarray, axes: np.ndarray, bgr: np.ndarray) -> None:
    """Draw the ball, each pixel by its covered share, a little darker at its rim.

    Its silhouette is the ellipse about `middle` (2,) with the half-axes (2, 2) as columns.
    """
    reach = np.abs(axes).sum(axis=1) + 1.5
    low = np.maximum(np.floor(middle - reach), 0).astype(int)
    high = np.minimum(np.ceil(middle + reach) + 1, canvas.shape[1::-1]).astype(int)
    if np.any(high <= low):
        return
    u, v = np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]))
    offsets = np.stack([u, v], axis=-1) - middle
    out = np.linalg.norm(offsets @ np.linalg.inv(axes).T, axis=-1)[..., None]
    cover = np.clip((1 - out) * np.sqrt(abs(np.linalg.det(axes))) + 0.5, 0, 1)
    shade = 1 - (1 - _BALL_RIM) * np.minimum(out, 1) ** 2
    patch = canvas[low[1] : high[1], low[0] : high[0]]
    patch[:] = np.rint(patch + cover * (shade * bgr - patch))


def _draw_arm(canvas: np.ndarray, outlines_px: np.ndarray) -> None:
    """Draw the arm's outlines (2, links, points, 2) from the tool up, higher over lower ones."""
    for rim, core in zip(*_fixed(outlines_px)[:, ::-1], strict=True):
        cv2.fillConvexPoly(canvas, rim, _LINK_RIM_BGR, cv2.LINE_AA, _SHIFT)
        cv2.fillConvexPoly(canvas, core, _LINK_BGR, cv2.LINE_AA, _SHIFT)


def _link_outlines(points_px: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Return outlines of links between points (n, k, 2) seen at `scale` (n, k) [px/m].

    Each outline is the hull of the discs at the link's two ends: of full size in [0], of the
    core's size in [1]; shape (2, n, k − 1, points, 2).
    """
    ends = np.stack([points_px[:, :-1], points_px[:, 1:]], axis=2)
    radii = np.stack([scale[:, :-1], scale[:, 1:]], axis=2) * DRAWN_RADII_M[:, None]
    radii = np.stack([radii, _LINK_CORE * radii])
    along = ends[:, :, 1] - ends[:, :, 0]
    length = np.linalg.norm(along, axis=-1) + 1e-9
    heading = np.arctan2(along[..., 1], along[..., 0])[..., None, None]
    tangent = np.arccos(np.clip((radii[..., 0] - radii[..., 1]) / length, -1, 1))[..., None]
    sweep = np.linspace(-1, 1, _CAP_POINTS)
    angles = np.stack([np.pi + sweep * (np.pi - tangent), sweep * tangent], axis=-2) + heading
    rays = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    outlines = ends[..., None, :] + radii[..., None, None] * rays
    return outlines.reshape(*outlines.shape[:3], 2 * _CAP_POINTS, 2)


def _fixed(pixels: np.ndarray) -> np.ndarray:  # as OpenCV takes sub-pixel places
    return np.rint(pixels * 2**_SHIFT).astype(np.int32)


def _at(times: np.ndarray, t_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Interpolate `values` (n, …) linearly, held constant beyond the ends."""
    after = np.clip(np.searchsorted(t_s, times), 1, len(t_s) - 1)
    share = np.clip((times - t_s[after - 1]) / (t_s[after] - t_s[after - 1]), 0.0, 1.0)
    share = share.reshape(-1, *[1] * (values.ndim - 1))
    return (1 - share) * values[after - 1] + share * values[after]


@lru_cache(maxsize=4)
def _vignette(camera: Camera, depth: float) -> np.ndarray:
    """Return the share of light that reaches each pixel, float32 (height, width)."""
    v, u = np.mgrid[: camera.height, : camera.width].astype(np.float32)
    (u0, v0), far = camera.centre_px, np.hypot(camera.width, camera.height) / 2
    return (1 - depth * ((u - u0) ** 2 + (v - v0) ** 2) / far**2).astype(np.float32)


@lru_cache(maxsize=4)
def _noise_bank(width: int, height: int, deviation: float) -> np.ndarray:
    """Return sensor noise about `_NOISE_GREY`, larger than a frame: each frame crops its own."""
    shape = (height + _NOISE_SLACK_PX, width + _NOISE_SLACK_PX, 3)
    drawn = np.random.default_rng(0).standard_normal(shape, dtype=np.float32)
    return np.clip(np.rint(_NOISE_GREY + deviation * drawn), 0, 2 * _NOISE_GREY).astype(np.uint8)


@lru_cache(maxsize=4)
def backdrop(camera: Camera, settings: PictureSettings) -> np.ndarray:
    """Return the empty scene through the lens, uint8 (height, width, 3), without vignetting."""
    origin_m = np.array([_FLOOR_M, settings.board_width_m / 2 + _FLOOR_M])
    texture, xy_m = _texture(settings, origin_m), _board_points(camera) + origin_m
    rows, columns = cv2.split((xy_m / _TEXEL_M - 0.5).astype(np.float32))
    fine = cv2.remap(texture, columns, rows, cv2.INTER_LINEAR, borderValue=_FLOOR_BGR)
    return cv2.resize(fine, (camera.width, camera.height), interpolation=cv2.INTER_AREA)


def _board_points(camera: Camera) -> np.ndarray:
    """Return where each oversampled pixel looks on the board, (…, …, 2) [m].

    The lens is smooth, so rays are undistorted at every eighth pixel and interpolated between.
    """
    size = np.array([camera.height, camera.width]) * _OVERSAMPLING
    counts = -(-size // _NODE_EVERY) + 2
    nodes = [(np.arange(n) - 0.5) * _NODE_EVERY - 0.5 for n in counts]
    v, u = np.meshgrid(*[(n + 0.5) / _OVERSAMPLING - 0.5 for n in nodes], indexing="ij")
    coarse = camera.to_plane(np.stack([u, v], axis=-1))
    fine = cv2.resize(coarse, None, fx=_NODE_EVERY, fy=_NODE_EVERY, interpolation=cv2.INTER_LINEAR)
    return fine[_NODE_EVERY : _NODE_EVERY + size[0], _NODE_EVERY : _NODE_EVERY + size[1]]


def _texture(settings: PictureSettings, origin_m: np.ndarray) -> np.ndarray:
    """Return floor and board from above, one texel a millimetre; rows run along x, columns y."""
    board_m = (settings.board_length_m, settings.board_width_m)
    shape = tuple(round((side + 2 * _FLOOR_M) / _TEXEL_M) for side in board_m)
    texture = np.full((*shape, 3), _FLOOR_BGR, np.float32)
    near = round(_FLOOR_M / _TEXEL_M)
    far, right = (round((_FLOOR_M + side) / _TEXEL_M) for side in board_m)
    texture[near:far, near:right] = settings.board_bgr
    texture *= _mottling(shape)[..., None]
    for number, centre in enumerate(settings.fiducials.centres_m):
        _stick_marker(texture, number, origin_m + centre, settings.fiducials.side_m)
    return np.clip(texture, 0, 255).astype(np.uint8)


def _mottling(shape: tuple[int, ...]) -> np.ndarray:
    """Return the uneven brightness of sanded paint, (rows, columns), about 1."""
    rng = np.random.default_rng(_BOARD_SEED)
    rows, columns = shape
    light = np.ones(shape, np.float32)
    for cell, depth in ((250, 0.03), (30, 0.015), (2, 0.01)):
        coarse = rng.standard_normal((rows // cell + 2, columns // cell + 2)).astype(np.float32)
        light += depth * cv2.resize(coarse, (columns, rows), interpolation=cv2.INTER_LINEAR)
    return light


def _stick_marker(texture: np.ndarray, number: int, centre_m: np.ndarray, side_m: float) -> None:
    """Print a marker with its white margin into the texture, each texel by its covered area."""
    bits = cv2.aruco.generateImageMarker(dictionary(), number, MODULES, borderBits=BORDER_MODULES)
    grey = np.pad(np.where(bits > 0, _PAPER_GREY, _INK_GREY), 1, constant_values=_PAPER_GREY)
    module = side_m / MODULES / _TEXEL_M
    edges = (np.arange(len(grey) + 1) - len(grey) / 2) * module + centre_m[:, None] / _TEXEL_M
    low, high = np.floor(edges[:, 0]).astype(int), np.ceil(edges[:, -1]).astype(int)
    rows, columns = (
        np.diff(np.clip(np.arange(a, b + 1)[:, None], e[:-1], e[1:]), axis=0)
        for a, b, e in zip(low, high, edges, strict=True)
    )  # (texels, modules): how much of each texel each module covers
    # The image's top is the marker's far edge (+x), its left the +y side: both axes run back.
    ink = rows @ grey[::-1, ::-1] @ columns.T
    patch = texture[low[0] : high[0], low[1] : high[1]]
    patch *= 1 - np.outer(rows.sum(1), columns.sum(1))[..., None]
    patch += ink[..., None]
