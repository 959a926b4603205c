"""The effects that the library holds: on the board, in the air, in the cable, its grip, the camera.

Their parameters, ranges and names stand in conf/effects.yaml. Last come flexible fields, forces of
no named mechanism that depend on one thing each: the field that explains what no effect does says
what the missing effect depends on. A field is a sum of fixed shapes with one strength each, an
acceleration in m/s², so that heavy and light parts feel it alike.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from robotcast.effects.effect import CableMotion, Effect, Memory

Array = np.ndarray
Forces = tuple[np.ndarray, np.ndarray]
AIR_KG_M3 = 1.2
GRAVITY_M_S2 = 9.81
SLOW_PER_M_S = 5.0  # bending slower than this is regularised
SHARP_M_S = 0.02  # over which a slip sets in, so that a fit can find the speed
ROUNDS = 20  # of the fixed-point iteration against a lens, each 2 |k| ρ² times as near


class AirDrag(Effect):
    """f = −½ ρ C A |v| v: A is a piece's side area 2 r l, of the endpoint its frontal area π r²."""

    def force(self, cable: CableMotion, *, C: Array) -> Forces:
        radius = cable.cable.radius_m
        area = np.append(2 * radius * cable.lengths_m, np.pi * radius**2).astype(np.float32)
        drag = np.sqrt(cable.vx * cable.vx + cable.vy * cable.vy)
        drag *= (-0.5 * AIR_KG_M3) * C * area
        return drag * cable.vx, drag * cable.vy


class BoardTilt(Effect):
    """f = m g (sx, sy): the slopes along x and y, positive where things slide to +x and +y."""

    def force(self, cable: CableMotion, *, sx: Array, sy: Array) -> Forces:
        weight = GRAVITY_M_S2 * cable.mass_kg
        return weight * sx, weight * sy


class ViscousFriction(Effect):
    """f = −c m v on every point, as of a lubricated board."""

    def force(self, cable: CableMotion, *, c: Array) -> Forces:
        drag = -c * cable.mass_kg
        return drag * cable.vx, drag * cable.vy


class AnisotropicFriction(Effect):
    """Coulomb friction (1 + a) times as strong across the cable as along it, the endpoint's too."""

    def force(self, cable: CableMotion, *, a: Array) -> Forces:
        across = cable.slip_y * cable.tx - cable.slip_x * cable.ty
        extra = -a * cable.friction_n * across
        return -extra * cable.ty, extra * cable.tx


class EndpointFriction(Effect):
    """μ of the endpoint × (1 + k)."""

    def force(self, cable: CableMotion, *, k: Array) -> Forces:
        return cable.along_slip(cable.on_endpoint(-k * cable.friction_n[:, -1:]))


class FrictionDrift(Effect):
    """μ × (1 + k o): o grows from 0 at the session's first cast to 1 at its last."""

    factor = "order"

    def in_cast(self, factor: Array, *, k: Array) -> dict[str, Array]:
        return {"k": k * np.nan_to_num(factor, nan=1.0)}  # a cast to come is as the last

    def force(self, cable: CableMotion, *, k: Array) -> Forces:
        return cable.along_slip(-k * cable.friction_n)


class FrictionPatch(Effect):
    """μ × (1 + k exp(−|p − p0|² / w²))."""

    def force(self, cable: CableMotion, *, k: Array, x0: Array, y0: Array, w: Array) -> Forces:
        dx, dy = (cable.x - x0) / w, (cable.y - y0) / w
        return cable.along_slip(np.exp(-(dx * dx + dy * dy)) * cable.friction_n * -k)


class StribeckFriction(Effect):
    """μ × (1 + k exp(−(|v| / vs)²)): stronger in slow motion."""

    def force(self, cable: CableMotion, *, k: Array, vs: Array) -> Forces:
        square = (cable.vx * cable.vx + cable.vy * cable.vy) / (vs * vs)
        return cable.along_slip(np.exp(-square) * cable.friction_n * -k)


class BendingDamping(Effect):
    """A bending moment E I η dκ/dt: the material answers late (Kelvin–Voigt)."""

    def damping_time(self, *, eta: Array) -> Array:
        return eta


class BendingHysteresis(Effect):
    """A Coulomb moment M in every hinge that opposes bending."""

    def bending_moment(self, cable: CableMotion, *, M: Array) -> Array:
        rate = cable.bending_rate
        return -M * rate / np.sqrt(rate * rate + SLOW_PER_M_S**2)


class RestingCurvature(Effect):
    """The bending springs rest at curvature κ, positive to the left."""

    def rest_curvature(self, cable: CableMotion, *, kappa: Array) -> Array:
        return kappa


class PlasticBending(Effect):
    """Elastic to the yield curvature κy, perfectly plastic beyond.

    The resting curvature κr follows the curvature κ so that |κ − κr| ≤ κy; `softness` is 1/κy.
    """

    def rest_curvature(self, cable: CableMotion, *, softness: Array) -> Array:
        kappa = cable.curvature
        rest = cable.memory.get("rest", np.zeros_like(kappa))
        yields = 1 / np.maximum(softness, 1e-12)
        cable.memory["rest"] = np.clip(rest, kappa - yields, kappa + yields)
        return cable.memory["rest"]


class MassGradient(Effect):
    """Mass per length × (1 + k s), s from −1 at the hand to 1 at the free end."""

    def mass_factor(self, along: Array, *, k: Array) -> Array:
        return 1 + k * along


class CableSlip(Effect):
    """In casts faster than v the cable has slid out of the gripper and is longer by s."""

    factor = "vmax"

    def in_cast(self, factor: Array, *, s: Array, v: Array) -> dict[str, Array]:
        faster = np.clip((np.nan_to_num(factor) - v) / SHARP_M_S, -30, 30)
        return {"s": s / (1 + np.exp(-faster))}

    def extra_length(self, *, s: Array) -> Array:
        return s


class ToolLag(Effect):
    """The real tool lags the logged one: τ dx/dt = u − x, exact where u is linear over a step."""

    def held_pose(self, pose: Array, memory: Memory, step_s: float, *, tau: Array) -> Array:
        logged, held = memory.get("logged", pose), memory.get("held", pose)
        decay = np.exp(-step_s / np.maximum(tau, 1e-12))
        behind = tau * (pose - logged) / step_s * (1 - decay)
        held = pose - behind + decay * (held - logged)
        memory["logged"], memory["held"] = pose, held
        return held


class ToolOffset(Effect):
    """The held point lies (dx, dy) from the logged one, in the tool's frame."""

    def held_pose(self, pose: Array, memory: Memory, step_s: float, *, dx: Array, dy: Array):
        x, y, yaw = pose[:, :1], pose[:, 1:2], pose[:, 2:]
        cosine, sine = np.cos(yaw), np.sin(yaw)
        return np.hstack([x + dx * cosine - dy * sine, y + dx * sine + dy * cosine, yaw])


class WristOffset(Effect):
    """The cable leaves the gripper at an angle β to its yaw."""

    def held_pose(self, pose: Array, memory: Memory, step_s: float, *, beta: Array) -> Array:
        return np.column_stack([pose[:, :2], pose[:, 2:] + beta])


class CameraClock(Effect):
    """The camera's clock runs (1 + k) times as fast: a stamp t means t / (1 + k)."""

    def seen_at(self, times_s: Array, *, k: Array) -> Array:
        return times_s / (1 + k)


class CameraLatency(Effect):
    """A waypoint stamped t shows where the end was at t − τ."""

    def seen_at(self, times_s: Array, *, tau: Array) -> Array:
        return times_s - tau


class CameraOffset(Effect):
    """Waypoints are shifted by (dx, dy)."""

    def seen(self, points_m: Array, *, dx: Array, dy: Array) -> Array:
        return points_m + np.stack([dx, dy], axis=2)

    def unseen(self, points_m: Array, *, dx: Array, dy: Array) -> Array:
        return points_m - np.stack([dx, dy], axis=2)


class CameraRotation(Effect):
    """Waypoints are turned about the base by φ, positive to the left."""

    def seen(self, points_m: Array, *, phi: Array) -> Array:
        cosine, sine, (x, y) = np.cos(phi), np.sin(phi), np.moveaxis(points_m, 2, 0)
        return np.stack([x * cosine - y * sine, y * cosine + x * sine], axis=2)

    def unseen(self, points_m: Array, *, phi: Array) -> Array:
        return self.seen(points_m, phi=-phi)


class CameraScale(Effect):
    """Waypoints are (1 + k) times as far from the base as they were."""

    def seen(self, points_m: Array, *, k: Array) -> Array:
        return points_m * (1 + k[:, None])

    def unseen(self, points_m: Array, *, k: Array) -> Array:
        return points_m / (1 + k[:, None])


class LensDistortion(Effect):
    """Waypoints lie (1 + k ρ²) times as far from the picture's middle; ρ is that distance."""

    def seen(self, points_m: Array, *, k: Array, x0: Array, y0: Array) -> Array:
        apart = points_m - np.stack([x0, y0], axis=-1)
        return points_m + k[..., None] * (apart**2).sum(axis=-1, keepdims=True) * apart

    def unseen(self, points_m: Array, *, k: Array, x0: Array, y0: Array) -> Array:
        apart = found = points_m - np.stack([x0, y0], axis=-1)
        for _ in range(ROUNDS):
            found = apart / (1 + k[..., None] * (found**2).sum(axis=-1, keepdims=True))
        return points_m + (found - apart)


Floats = Sequence[float]
PRIOR_SD = 0.1  # of the range: what no cast passes stays where it is


class _Field(Effect):
    """A field with numbered strengths c0, c1, …; `endpoint` says that it acts there alone."""

    unit, strongest, probe, endpoint = "m/s²", 4.0, 0.25, False

    def __init__(self, name: str, text: str, n: int, of: str) -> None:
        strength = {"unit": self.unit, "lower": -self.strongest, "upper": self.strongest}
        strength |= {"null_at": 0.0, "probes": [self.probe], "prior_sd": PRIOR_SD}
        super().__init__(name, text, {f"c{k}": strength for k in range(n)}, of)

    def _strengths(self, values: Mapping[str, np.ndarray]) -> np.ndarray:
        return np.concatenate([values[p.name] for p in self.parameters], axis=1)


class PlaceField(_Field):
    """An acceleration that depends on where a point is: Gaussian bumps on a grid."""

    def __init__(
        self, name: str, text: str, x_m: Floats, y_m: Floats, width_m: float, endpoint: bool = False
    ) -> None:
        self.x_m, self.y_m = (np.asarray(at, np.float32) for at in (x_m, y_m))
        self.width_m, self.endpoint = width_m, endpoint
        super().__init__(name, text, 2 * len(x_m) * len(y_m), "place")

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
        x = dry * cable.slip_x + viscous * cable.vx
        y = dry * cable.slip_y + viscous * cable.vy
        return -cable.mass_kg * x, -cable.mass_kg * y

    def at(self, points_m: np.ndarray, strengths: np.ndarray) -> np.ndarray:
        """Return the decelerations (m, 1) of what moves at 1 m/s at points (m, 2)."""
        return super().at(points_m, strengths).sum(axis=1, keepdims=True)


class AlongMotionField(_Field):
    """A deceleration against the motion that depends on speed or on time: hats on a grid."""

    def __init__(self, name: str, text: str, of: str, at: Floats) -> None:
        if of not in ("speed", "time"):
            raise ValueError(f"field {name}: of must be speed or time, got {of}")
        self.at_values = np.asarray(at, dtype=float)
        super().__init__(name, text, len(at), of)

    def force(self, cable: CableMotion, **values: np.ndarray) -> Forces:
        timed = self.depends_on == "time"
        argument = np.full((1, 1), cable.time_s) if timed else np.hypot(cable.vx, cable.vy)
        size = np.zeros_like(cable.vx)
        for k, hat in enumerate(np.eye(len(self.at_values))):
            size += values[f"c{k}"] * np.interp(argument, self.at_values, hat).astype(np.float32)
        return cable.along_slip(-size * cable.mass_kg)


class HeadingField(_Field):
    """A force that depends on how the cable lies: across it, and on its compass heading."""

    def __init__(self, name: str, text: str) -> None:
        super().__init__(name, text, 5, "heading")

    def force(self, cable: CableMotion, **values: np.ndarray) -> Forces:
        across = cable.slip_y * cable.tx - cable.slip_x * cable.ty
        cosine, sine = cable.tx**2 - cable.ty**2, 2 * cable.tx * cable.ty
        drag = -(values["c1"] * cosine + values["c2"] * sine)
        lift, mass = -values["c0"] * across, cable.mass_kg
        x = drag * cable.slip_x - lift * cable.ty + values["c3"] * cable.tx
        y = drag * cable.slip_y + lift * cable.tx + values["c3"] * cable.ty
        return mass * (x - values["c4"] * cable.ty), mass * (y + values["c4"] * cable.tx)


class EndpointField(_Field):
    """A force on the endpoint alone that depends on nothing else: constant, dry, viscous."""

    def __init__(self, name: str, text: str) -> None:
        super().__init__(name, text, 4, "endpoint")

    def force(self, cable: CableMotion, **values: np.ndarray) -> Forces:
        mass = cable.on_endpoint(cable.mass_kg[:, -1:])
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
