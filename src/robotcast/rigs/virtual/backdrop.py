"""What stands still before the virtual camera: floor, painted board, markers."""

from functools import lru_cache

import cv2
import numpy as np

from robotcast.vision.camera import Camera
from robotcast.vision.fiducials import BORDER_MODULES, MODULES, FiducialBoard, dictionary

FLOOR_BGR = (66.0, 64.0, 62.0)
_PAPER_GREY, _INK_GREY = 225.0, 28.0
_TEXEL_M = 0.001
_MARGIN_M = 0.7
_OVERSAMPLING = 2
_NODE_EVERY = 8
_BOARD_SEED = 20220411


@lru_cache(maxsize=4)
def backdrop(
    camera: Camera,
    fiducials: FiducialBoard,
    board_bgr: tuple[float, float, float],
    board_m: tuple[float, float],
) -> np.ndarray:
    """Return the empty scene through the lens, uint8 (height, width, 3), without vignetting.

    Parameters
    ----------
    board_m : the board's length along x and width along y.
    """
    texture = _texture(fiducials, board_bgr, board_m)
    xy_m = _board_points(camera)
    rows = (xy_m[..., 0] + _MARGIN_M) / _TEXEL_M - 0.5
    columns = (xy_m[..., 1] + board_m[1] / 2 + _MARGIN_M) / _TEXEL_M - 0.5
    fine = cv2.remap(
        texture,
        columns.astype(np.float32),
        rows.astype(np.float32),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=FLOOR_BGR,
    )
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


def _texture(
    fiducials: FiducialBoard,
    board_bgr: tuple[float, float, float],
    board_m: tuple[float, float],
) -> np.ndarray:
    """Return floor and board from above, one texel a millimetre; rows run along x, columns y."""
    shape = tuple(round((side + 2 * _MARGIN_M) / _TEXEL_M) for side in board_m)
    texture = np.empty((*shape, 3), np.float32)
    texture[:] = FLOOR_BGR
    near, far = (round(m / _TEXEL_M) for m in (_MARGIN_M, _MARGIN_M + board_m[0]))
    left, right = (round(m / _TEXEL_M) for m in (_MARGIN_M, _MARGIN_M + board_m[1]))
    texture[near:far, left:right] = board_bgr
    texture *= _mottling(shape)[..., None]
    origin = np.array([_MARGIN_M, board_m[1] / 2 + _MARGIN_M])
    for number, centre in enumerate(fiducials.centres_m):
        _stick_marker(texture, number, origin + centre, fiducials.side_m)
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
    edges = (np.arange(len(grey) + 1) - len(grey) / 2) * module
    spans = [_coverage(edges + c / _TEXEL_M) for c in centre_m]
    (row, row_cover), (column, column_cover) = spans
    # The image's top is the marker's far edge (+x), its left the +y side: both axes run back.
    ink = row_cover @ grey[::-1, ::-1] @ column_cover.T
    bare = 1 - np.outer(row_cover.sum(1), column_cover.sum(1))
    patch = texture[row : row + len(ink), column : column + ink.shape[1]]
    patch *= bare[..., None]
    patch += ink[..., None]


def _coverage(edges: np.ndarray) -> tuple[int, np.ndarray]:
    """Return the first texel and how much of each texel each module covers, (texels, modules)."""
    first, last = int(np.floor(edges[0])), int(np.ceil(edges[-1]))
    texels = np.arange(first, last)[:, None]
    overlap = np.minimum(texels + 1, edges[1:]) - np.maximum(texels, edges[:-1])
    return first, np.maximum(overlap, 0.0)
