"""How much of each pixel the bright endpoint covers, told by colour alone."""

import cv2
import numpy as np

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


def light_at(light: np.ndarray, pixel: np.ndarray, shape: tuple[int, ...]) -> float:
    """Return the share of light at a pixel (2,) of an image of `shape` (height, width, …)."""
    return float(1 + light[0] * _squared_radius(pixel, shape[1], shape[0]) + light[1])


def _squared_radius(pixels: np.ndarray, width: int, height: int) -> np.ndarray:
    centre = np.array([width - 1, height - 1]) / 2
    return np.sum((pixels - centre) ** 2, axis=-1) / width**2
