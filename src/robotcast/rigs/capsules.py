"""Distances between straight links."""

import numpy as np


def segment_distance(
    start_a: np.ndarray, end_a: np.ndarray, start_b: np.ndarray, end_b: np.ndarray
) -> np.ndarray:
    """Return the distance between line segments (..., 3) [m] as (...).

    The closest points of two segments, after C. Ericson, Real-Time Collision Detection, 5.1.9:
    the closest pair on the infinite lines, clamped to one segment and then to the other.
    """
    along_a, along_b, between = end_a - start_a, end_b - start_b, start_a - start_b
    aa, bb, ab = _dot(along_a, along_a), _dot(along_b, along_b), _dot(along_a, along_b)
    a, b = _dot(along_a, between), _dot(along_b, between)
    parallel = aa * bb - ab * ab
    tiny = 1e-12
    s = np.where(parallel > tiny * aa * bb, ab * b - a * bb, 0.0)
    s = np.clip(s / np.maximum(parallel, tiny), 0.0, 1.0)
    t = np.clip((ab * s + b) / np.maximum(bb, tiny), 0.0, 1.0)
    s = np.clip((ab * t - a) / np.maximum(aa, tiny), 0.0, 1.0)
    gap = between + s[..., None] * along_a - t[..., None] * along_b
    return np.sqrt(_dot(gap, gap))


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("...i,...i->...", a, b)
