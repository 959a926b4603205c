"""Flexible fields: forces of no named mechanism that depend on one thing.

When no effect of the library explains what is left, fitting one field for everything that a
force may depend on says what the missing effect depends on. A field is a sum of fixed shapes
with one strength each, an acceleration in m/s², so that heavy and light parts feel it alike.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from robotcast.effects.effect import CableMotion, Effect

Forces = tuple[np.ndarray, np.ndarray]
Floats = Sequence[float]
PRIOR_SD = 0.1  # of the range: what no cast passes stays where it is


class _Field(Effect):
    """A field with numbered strengths c0, c1, …; `endpoint` makes it act there alone."""

    unit, strongest, probe = "m/s²", 4.0, 0.25

    def __init__(self, name: str, text: str, n: int, of: str, endpoint: bool = False) -> None:
        strength = {"unit": self.unit, "lower": -self.strongest, "upper": self.strongest}
        strength |= {"null_at": 0.0, "probes": [self.probe], "prior_sd": PRIOR_SD}
        super().__init__(name, text, {f"c{k}": strength for k in range(n)}, of)
        self.endpoint = endpoint

    def _masses(self, cable: CableMotion) -> np.ndarray:
        """Return the masses that the field accelerates."""
        return cable.on_endpoint(cable.mass_kg[:, -1:]) if self.endpoint else cable.mass_kg

    def _strengths(self, values: Mapping[str, np.ndarray]) -> np.ndarray:
        return np.concatenate([values[p.name] for p in self.parameters], axis=1)


class PlaceField(_Field):
    """An acceleration that depends on where a point is: Gaussian bumps on a grid."""

    def __init__(
        self, name: str, text: str, x_m: Floats, y_m: Floats, width_m: float, endpoint: bool = False
    ) -> None:
        self.x_m, self.y_m = (np.asarray(at, np.float32) for at in (x_m, y_m))
        self.width_m = width_m
        super().__init__(name, text, 2 * len(x_m) * len(y_m), "place", endpoint)

    def force(self, cable: CableMotion, **values: np.ndarray) -> Forces:
        where = slice(-1, None) if self.endpoint else slice(None)
        at, mass = (cable.x[:, where], cable.y[:, where]), cable.mass_kg[:, where]
        x, y = (mass * part for part in self._accelerations(*at, self._strengths(values)))
        return (cable.on_endpoint(x), cable.on_endpoint(y)) if self.endpoint else (x, y)

    def at(self, points_m: np.ndarray, strengths: np.ndarray) -> np.ndarray:
        """Return the accelerations (m, 2) at points (m, 2)."""
        x, y = points_m.T[:, None].astype(np.float32)
        return np.concatenate(self._accelerations(x, y, strengths[None])).T

    def _accelerations(self, x: np.ndarray, y: np.ndarray, strengths: np.ndarray) -> Forces:
        """Return both components (n, m) at points (n, m); a bump is a product of two hats.

        `strengths` (n, n_strengths): of every centre, x before y, its two components.
        """
        bumps = self._hats(x, self.x_m)[..., None] * self._hats(y, self.y_m)[..., None, :]
        found = bumps.reshape(*x.shape, -1) @ strengths.reshape(len(x), -1, 2)
        return found[..., 0], found[..., 1]

    def _hats(self, at: np.ndarray, centres: np.ndarray) -> np.ndarray:
        apart = at[..., None] - centres
        return np.exp(apart * apart * np.float32(-0.5 / self.width_m**2))


class PlaceResistanceField(PlaceField):
    """A deceleration against the motion that depends on where a point is.

    Every bump has two strengths, one of dry resistance, which does not depend on the speed, and
    one of viscous resistance, at 1 m/s.
    """

    def force(self, cable: CableMotion, **values: np.ndarray) -> Forces:
        dry, viscous = self._accelerations(cable.x, cable.y, self._strengths(values))
        mass = self._masses(cable)
        x = dry * cable.slip_x + viscous * cable.vx
        y = dry * cable.slip_y + viscous * cable.vy
        return -mass * x, -mass * y

    def at(self, points_m: np.ndarray, strengths: np.ndarray) -> np.ndarray:
        """Return the decelerations (m, 1) of what moves at 1 m/s at points (m, 2)."""
        return super().at(points_m, strengths).sum(axis=1, keepdims=True)


class AlongMotionField(_Field):
    """A deceleration against the motion that depends on speed or on time: hats on a grid."""

    def __init__(self, name: str, text: str, of: str, at: Floats, endpoint: bool = False) -> None:
        if of not in ("speed", "time"):
            raise ValueError(f"field {name}: of must be speed or time, got {of}")
        self.at_values = np.asarray(at, dtype=float)
        super().__init__(name, text, len(at), of, endpoint)

    def force(self, cable: CableMotion, **values: np.ndarray) -> Forces:
        timed = self.depends_on == "time"
        argument = np.full((1, 1), cable.time_s) if timed else np.hypot(cable.vx, cable.vy)
        size = np.zeros_like(cable.vx)
        for k, hat in enumerate(np.eye(len(self.at_values))):
            size += values[f"c{k}"] * np.interp(argument, self.at_values, hat).astype(np.float32)
        return cable.along_slip(-size * self._masses(cable))


class HeadingField(_Field):
    """A force that depends on how the cable lies: across it, and on its compass heading."""

    def __init__(self, name: str, text: str) -> None:
        super().__init__(name, text, 5, "heading")

    def force(self, cable: CableMotion, **values: np.ndarray) -> Forces:
        across = cable.slip_y * cable.tx - cable.slip_x * cable.ty
        cosine, sine = cable.tx**2 - cable.ty**2, 2 * cable.tx * cable.ty
        drag = -(values["c1"] * cosine + values["c2"] * sine)
        lift = -values["c0"] * across
        mass = self._masses(cable)
        x = drag * cable.slip_x - lift * cable.ty + values["c3"] * cable.tx
        y = drag * cable.slip_y + lift * cable.tx + values["c3"] * cable.ty
        return mass * (x - values["c4"] * cable.ty), mass * (y + values["c4"] * cable.tx)


class EndpointField(_Field):
    """A force on the endpoint alone that depends on nothing else: constant, dry, viscous."""

    def __init__(self, name: str, text: str) -> None:
        super().__init__(name, text, 4, "endpoint", True)

    def force(self, cable: CableMotion, **values: np.ndarray) -> Forces:
        mass = self._masses(cable)
        x = values["c0"] - values["c2"] * cable.slip_x - values["c3"] * cable.vx
        y = values["c1"] - values["c2"] * cable.slip_y - values["c3"] * cable.vy
        return mass * x, mass * y


class BendingField(_Field):
    """A resting curvature that depends on the curvature: constant, square and cube of it."""

    unit, strongest, probe = "1/m", 20.0, 1.0

    def __init__(self, name: str, text: str, curvature_per_m: float) -> None:
        self.curvature_per_m = curvature_per_m
        super().__init__(name, text, 3, "bending")

    def rest_curvature(self, cable: CableMotion, **values: np.ndarray) -> np.ndarray:
        ratio = cable.curvature / self.curvature_per_m
        return values["c0"] + values["c1"] * ratio * np.abs(ratio) + values["c2"] * ratio**3
