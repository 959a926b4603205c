"""What an effect sees of a batch of moving cables, whatever simulator moves them."""

from dataclasses import dataclass

import numpy as np

from robotcast.measurements.measurement_set import Cable


@dataclass(frozen=True)
class CableMotion:
    """A batch of cables at one instant.

    Points run from the hand to the free end: one for every piece of cable, at its centre, then
    the endpoint. Arrays of them are (n_sim, n_points).

    Attributes
    ----------
    cable : what its owner measured of it.
    time_s : since the start of the cast.
    step_s : until the next instant.
    lengths_m : ndarray of shape (n_points − 1,), of the pieces.
    x, y : position [m].
    vx, vy : velocity [m/s].
    slip_x, slip_y : the way each point slides, v / √(v² + ε²): a unit vector but near rest.
    tx, ty : unit vector along the cable; of the endpoint, along the last piece.
    mass_kg : of the points.
    friction_n : μ m g of the points.
    bend_rad, bend_rate_rad_s : ndarrays of shape (n_sim, n_hinges), positive to the left.
    bends_m : ndarray of shape (n_hinges,), the length of cable whose bending a hinge carries.
    memory : what an effect wants to find again at the next step; arrays with n_sim rows.
    """

    cable: Cable
    time_s: float
    step_s: float
    lengths_m: np.ndarray
    x: np.ndarray
    y: np.ndarray
    vx: np.ndarray
    vy: np.ndarray
    slip_x: np.ndarray
    slip_y: np.ndarray
    tx: np.ndarray
    ty: np.ndarray
    mass_kg: np.ndarray
    friction_n: np.ndarray
    bend_rad: np.ndarray
    bend_rate_rad_s: np.ndarray
    bends_m: np.ndarray
    memory: dict[str, np.ndarray]

    @property
    def curvature(self) -> np.ndarray:
        """Curvature at the hinges, (n_sim, n_hinges) [1/m]."""
        return self.bend_rad / self.bends_m

    @property
    def bending_rate(self) -> np.ndarray:
        """How fast the curvature changes, (n_sim, n_hinges) [1/(m s)]."""
        return self.bend_rate_rad_s / self.bends_m

    def on_endpoint(self, values: np.ndarray) -> np.ndarray:
        """Return values (n_sim, 1) at the endpoint and 0 at every other point."""
        spread = np.zeros_like(self.mass_kg)
        spread[:, -1:] = values
        return spread
