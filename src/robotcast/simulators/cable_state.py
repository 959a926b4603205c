"""Where the mass points of a batch of cables are, whatever moves them."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class CableState:
    """Where the cables' mass points are and how they move, for a batch of simulations.

    The n + 1 points are the segments' centres from hand to end, then the endpoint. Arrays are
    float32, their first axis x and y.

    Attributes
    ----------
    heading : ndarray of shape (2, n_sim, n), unit vector along each segment.
    position_m : ndarray of shape (2, n_sim, n + 1).
    velocity_m_s : ndarray of shape (2, n_sim, n + 1).
    slip : ndarray of shape (2, n_sim, n + 1), v / √(v² + ε²): the way each point slides.
    force_n : ndarray of shape (2, n_sim, n + 1), what is to be applied to the points.
    """

    heading: np.ndarray
    position_m: np.ndarray
    velocity_m_s: np.ndarray
    slip: np.ndarray
    force_n: np.ndarray

    @property
    def end_m(self) -> np.ndarray:
        """Position of the free end, (2, n_sim)."""
        return self.position_m[:, :, -1]
