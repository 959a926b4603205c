"""How late the camera's frames are against the controller's clock, from a short known motion.

Only the arm tells it: the cable follows the arm late, and would be taken for a late camera.
"""

import cv2
import numpy as np

from robotcast.vision.camera import Camera

WIDEST_S = 0.3
FEWEST_FRAMES = 15
LEAST_CORRELATION = 0.9
_STEPS = 601
_WIDE_PX = 320
_MARGIN_M = 0.05


class ArmPixels:
    """Those few grey pixels of a picture that the arm may cover, and the cable does not.

    Parameters
    ----------
    held_m : how far from the base the arm holds the cable, which lies beyond.
    """

    def __init__(self, camera: Camera, held_m: float) -> None:
        scale = _WIDE_PX / camera.width
        self._size = _WIDE_PX, round(camera.height * scale)
        v, u = np.mgrid[: self._size[1], : self._size[0]]
        places = camera.to_plane((np.stack([u, v], axis=-1) + 0.5) / scale - 0.5)
        self._inside = np.linalg.norm(places, axis=-1) < held_m - _MARGIN_M

    def of(self, picture: np.ndarray) -> np.ndarray:
        """Return the grey values (m,) of a picture (height, width, 3)."""
        few = cv2.resize(picture, self._size, interpolation=cv2.INTER_AREA)
        return cv2.cvtColor(few, cv2.COLOR_BGR2GRAY)[self._inside]


def camera_offset(
    pictures: np.ndarray, seen_s: np.ndarray, t_s: np.ndarray, angle_rad: np.ndarray
) -> float:
    """Return by how much frames are stamped late [s].

    Whatever moves with the arm moves the picture along one direction: the first principal
    component of the frames follows the angle. The offset is where it fits the angle best.

    Parameters
    ----------
    pictures : ndarray of shape (k, m), each frame's `ArmPixels`.
    seen_s : ndarray of shape (k,), when each was captured, in the controller's time.
    t_s, angle_rad : ndarrays of shape (n,), the arm's actual motion.
    """
    inside = (seen_s - WIDEST_S >= t_s[0]) & (seen_s <= t_s[-1])
    if inside.sum() < FEWEST_FRAMES:
        raise ValueError(
            f"camera: only {int(inside.sum())} frames during the arm's swaying, "
            f"at least {FEWEST_FRAMES} are needed"
        )
    values = pictures[inside].astype(float)
    _, _, directions = np.linalg.svd(values - values.mean(axis=0), full_matrices=False)
    signal = (values - values.mean(axis=0)) @ directions[0]
    tried_s = np.linspace(-WIDEST_S / 3, WIDEST_S, _STEPS)
    fits = np.array([_fit(signal, np.interp(seen_s[inside] - o, t_s, angle_rad)) for o in tried_s])
    best = int(np.argmax(fits))
    if fits[best] < LEAST_CORRELATION or not 0 < best < _STEPS - 1:
        raise ValueError(
            f"camera: the arm's swaying is not seen in the picture (correlation {fits[best]:.2f}); "
            "the arm must be in the camera's view, and its exposure short"
        )
    low, middle, high = fits[best - 1 : best + 2]
    shift = 0.5 * (low - high) / (low - 2 * middle + high) if low - 2 * middle + high else 0.0
    return float(tried_s[best] + shift * (tried_s[1] - tried_s[0]))


def _fit(signal: np.ndarray, angle: np.ndarray) -> float:
    """Return the multiple correlation of a signal with an angle and its square, 0–1."""
    shapes = np.column_stack([np.ones_like(angle), angle, angle**2])
    left = signal - shapes @ np.linalg.lstsq(shapes, signal, rcond=None)[0]
    whole = signal - signal.mean()
    return float(np.sqrt(max(0.0, 1 - left @ left / (whole @ whole))))
