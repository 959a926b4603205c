"""Difference equations of second order, by which the arm and the held end lag."""

import numpy as np


def lagged(numerator: np.ndarray, denominator: np.ndarray, asked: np.ndarray) -> np.ndarray:
    """Return what follows `asked` (n, k) in time, (n, k), at rest on its first row before.

    It gives the bits of `scipy.signal.lfilter` from the state of `lfilter_zi`. Importing
    scipy.signal takes as long as every other import of a rig's process together.

    Parameters
    ----------
    numerator, denominator : three coefficients of z⁰, z⁻¹ and z⁻²; neither may hold an integrator.
    """
    b, a = (np.asarray(c, dtype=float) / denominator[0] for c in (numerator, denominator))
    rest = np.linalg.solve([[1.0 + a[1], -1.0], [a[2], 1.0]], b[1:] - a[1:] * b[0])
    columns = (_follow(b.tolist(), a.tolist(), rest * x[0], x.tolist()) for x in asked.T)
    return np.column_stack(list(columns))


def _follow(b: list[float], a: list[float], state: np.ndarray, column: list[float]) -> list[float]:
    (b0, b1, b2), (_, a1, a2), (first, second) = b, a, state.tolist()
    followed = []
    for x in column:  # the direct form II transposed
        y = first + b0 * x
        first = second + b1 * x - a1 * y
        second = b2 * x - a2 * y
        followed.append(y)
    return followed
