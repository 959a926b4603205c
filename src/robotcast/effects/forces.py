"""Forces that the board and the air may put on a cable."""

import numpy as np

from robotcast.effects.effect import CableMotion, Effect

Forces = tuple[np.ndarray, np.ndarray]
AIR_KG_M3 = 1.2
GRAVITY_M_S2 = 9.81


class AirDrag(Effect):
    """f = −½ ρ C A |v| v: A is a piece's side area 2 r l, of the endpoint its frontal area π r²."""

    def force(self, cable: CableMotion, *, C: np.ndarray) -> Forces:
        radius = cable.cable.radius_m
        area = np.append(2 * radius * cable.lengths_m, np.pi * radius**2).astype(np.float32)
        drag = np.sqrt(cable.vx * cable.vx + cable.vy * cable.vy)
        drag *= (-0.5 * AIR_KG_M3) * C * area
        return drag * cable.vx, drag * cable.vy


class BoardTilt(Effect):
    """f = m g (sx, sy): the slopes along x and y, positive where things slide to +x and +y."""

    def force(self, cable: CableMotion, *, sx: np.ndarray, sy: np.ndarray) -> Forces:
        weight = GRAVITY_M_S2 * cable.mass_kg
        return weight * sx, weight * sy


class ViscousFriction(Effect):
    """f = −c m v on every point, as of a lubricated board."""

    def force(self, cable: CableMotion, *, c: np.ndarray) -> Forces:
        drag = -c * cable.mass_kg
        return drag * cable.vx, drag * cable.vy


class AnisotropicFriction(Effect):
    """Coulomb friction (1 + a) times as strong across the cable as along it, the endpoint's too."""

    def force(self, cable: CableMotion, *, a: np.ndarray) -> Forces:
        across = cable.slip_y * cable.tx - cable.slip_x * cable.ty
        extra = -a * cable.friction_n * across
        return -extra * cable.ty, extra * cable.tx


class EndpointFriction(Effect):
    """μ of the endpoint × (1 + k)."""

    def force(self, cable: CableMotion, *, k: np.ndarray) -> Forces:
        extra = cable.on_endpoint(-k * cable.friction_n[:, -1:])
        return extra * cable.slip_x, extra * cable.slip_y


class FrictionDrift(Effect):
    """μ × (1 + k o): o grows from 0 at the session's first cast to 1 at its last."""

    factor = "order"

    def in_cast(self, factor: np.ndarray, *, k: np.ndarray) -> dict[str, np.ndarray]:
        return {"k": k * np.nan_to_num(factor, nan=1.0)}  # a cast to come is as the last

    def force(self, cable: CableMotion, *, k: np.ndarray) -> Forces:
        extra = -k * cable.friction_n
        return extra * cable.slip_x, extra * cable.slip_y


class FrictionPatch(Effect):
    """μ × (1 + k exp(−|p − p0|² / w²))."""

    def force(
        self, cable: CableMotion, *, k: np.ndarray, x0: np.ndarray, y0: np.ndarray, w: np.ndarray
    ) -> Forces:
        dx, dy = (cable.x - x0) / w, (cable.y - y0) / w
        extra = np.exp(-(dx * dx + dy * dy)) * cable.friction_n * -k
        return extra * cable.slip_x, extra * cable.slip_y


class StribeckFriction(Effect):
    """μ × (1 + k exp(−(|v| / vs)²)): stronger in slow motion."""

    def force(self, cable: CableMotion, *, k: np.ndarray, vs: np.ndarray) -> Forces:
        square = (cable.vx * cable.vx + cable.vy * cable.vy) / (vs * vs)
        extra = np.exp(-square) * cable.friction_n * -k
        return extra * cable.slip_x, extra * cable.slip_y
