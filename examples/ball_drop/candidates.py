"""What free fall may lack: mechanisms that act on the ball, on its clock or on the camera.

Every hook gets the values of the mechanism's parameters by name, arrays (n_vectors, 1) that
broadcast against those of all balls, (n_vectors, n_balls). At its null a mechanism does nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robotcast.diagnosis.model import Record
from robotcast.fitting.parameter import Parameter

G_M_S2 = 9.81
AIR_KG_M3 = 1.2
USUAL_M_S = 10.0  # both laws of drag brake alike at this speed, so that their sizes compare


@dataclass(frozen=True)
class Balls:
    """The balls that fall: masses and diameters, each (n_balls,)."""

    mass_kg: np.ndarray
    diameter_m: np.ndarray

    @classmethod
    def of(cls, records: Sequence[Record]) -> "Balls":
        """Take them from the records' factors."""
        return cls(*(np.array([r.factors[name] for r in records]) for name in ("mass", "diameter")))

    @property
    def drag_per_m(self) -> np.ndarray:
        """½ ρ A / m, so that drag of coefficient C brakes by C × this × v², (n_balls,)."""
        return AIR_KG_M3 * np.pi / 8 * self.diameter_m**2 / self.mass_kg


class Mechanism:
    """A candidate of a diagnosis; each kind overrides the hook through which it acts."""

    depends_on: str | None = None

    def __init__(self, name: str, text: str, *parameters: Parameter) -> None:
        self.name, self.text, self.parameters = name, text, parameters

    def acceleration(self, speed_m_s: np.ndarray, balls: Balls, **values: np.ndarray) -> np.ndarray:
        """Return the further acceleration, downwards [m/s²], of balls that fall so fast."""
        return np.zeros_like(speed_m_s)

    def happened(self, stamp_s: np.ndarray, **values: np.ndarray) -> np.ndarray:
        """Return when that happened which the camera stamps `stamp_s`."""
        return stamp_s

    def seen(self, fallen_m: np.ndarray, **values: np.ndarray) -> np.ndarray:
        """Return how far a ball seems to have fallen that fell `fallen_m`."""
        return fallen_m


class QuadraticDrag(Mechanism):
    """a = −½ ρ C A v² / m."""

    def acceleration(self, speed_m_s: np.ndarray, balls: Balls, *, c: np.ndarray) -> np.ndarray:
        return -c * balls.drag_per_m * np.abs(speed_m_s) * speed_m_s


class LinearDrag(Mechanism):
    """a = −½ ρ C A v (10 m/s) / m.

    It differs from the quadratic law in the exponent alone. Stokes' law for a slow ball in a thick
    liquid would grow with the radius, not the area; air around a falling ball is far from it.
    """

    def acceleration(self, speed_m_s: np.ndarray, balls: Balls, *, c: np.ndarray) -> np.ndarray:
        return -c * balls.drag_per_m * USUAL_M_S * speed_m_s


class Buoyancy(Mechanism):
    """a = −share × (mass of the air that a full ball displaces) g / m."""

    def acceleration(self, speed_m_s: np.ndarray, balls: Balls, *, share: np.ndarray) -> np.ndarray:
        displaced_kg = AIR_KG_M3 * np.pi / 6 * balls.diameter_m**3
        return -share * displaced_kg / balls.mass_kg * G_M_S2


class ReleaseTime(Mechanism):
    """Every ball is let go `tau` later than its first metres tell."""

    def happened(self, stamp_s: np.ndarray, *, tau: np.ndarray) -> np.ndarray:
        return stamp_s - tau


class ScaleError(Mechanism):
    """Distances are seen (1 + k) times as long."""

    def seen(self, fallen_m: np.ndarray, *, k: np.ndarray) -> np.ndarray:
        return (1 + k) * fallen_m


class SpeedField(Mechanism):
    """A flexible field: any resistance that depends on speed alone, given at `at_m_s`."""

    depends_on = "speed"
    at_m_s = np.array([0.0, 4.0, 8.0, 12.0, 16.0])

    def acceleration(self, speed_m_s: np.ndarray, balls: Balls, **values: np.ndarray) -> np.ndarray:
        hats = np.eye(len(self.at_m_s))
        parts = (
            value * np.interp(speed_m_s, self.at_m_s, hat)
            for value, hat in zip(values.values(), hats, strict=True)
        )
        return -sum(parts, np.zeros_like(speed_m_s))


def mechanisms() -> tuple[Mechanism, ...]:
    """Return every candidate, the flexible field last."""

    def strength(name: str, unit: str, least: float, most: float, *probes: float) -> Parameter:
        return Parameter(name, unit, least, most, nominal=0.0, null=0.0, probes=probes)

    return (
        QuadraticDrag(
            "quadratic_drag",
            "air drag that grows with the square of the speed",
            strength("c", "1", -0.5, 2.0, 0.2, 0.5),
        ),
        LinearDrag(
            "linear_drag",
            "air drag that grows in proportion to the speed",
            strength("c", "1", -0.5, 2.0, 0.2, 0.5),
        ),
        Buoyancy(
            "buoyancy",
            "the buoyancy of the ball in air",
            strength("share", "1", -2.0, 2.0, 0.5, 1.0),
        ),
        ReleaseTime(
            "release_time",
            "the balls are let go later than assumed",
            strength("tau", "s", -0.5, 0.5, -0.05, 0.05),
        ),
        ScaleError(
            "scale_error",
            "the camera's scale is wrong",
            strength("k", "1", -0.5, 0.5, -0.05, 0.05),
        ),
        SpeedField(
            "speed_field",
            "a resistance that depends on the speed",
            *(strength(f"c{k}", "m/s²", -5.0, 15.0, 1.0) for k in range(len(SpeedField.at_m_s))),
        ),
    )
