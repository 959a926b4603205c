"""What can be wrong with the air: MuJoCo's own fluid forces."""

from dataclasses import dataclass

import mujoco
import numpy as np

from robotcast.measurements.measurement_set import Cable
from robotcast.rigs.virtual.cable import CableTruth
from robotcast.rigs.virtual.hidden.effect import Built

AIR_KG_M3 = 1.2
OIL_PA_S = 10.0  # any value: the probes' radii make up for it


@dataclass(frozen=True)
class Air(Built):
    """Drag ½ ρ C A v² on every piece, A = 2 r l of a piece, π R² of the ball at the end.

    MuJoCo's drag on a sphere is ρ C' π r² v² whatever its heading (the ½ is part of its C'), so
    every piece gets a sphere that touches nothing, with C' = ½ C A / (π r²).
    """

    drag: float

    def build(self, spec: mujoco.MjSpec, cable: Cable, truth: CableTruth) -> None:
        spec.option.density = AIR_KG_M3
        side = 2 * cable.radius_m * cable.length_m / truth.segments
        for index in range(truth.segments):
            body = spec.body(f"segment_{index}")
            _add_probe(body, cable.radius_m, 0.5 * self.drag * side / (np.pi * cable.radius_m**2))
        _add_probe(spec.body("endpoint"), truth.endpoint_radius_m, 0.5 * self.drag)


@dataclass(frozen=True)
class Oil(Built):
    """A film that holds every piece back by c m v.

    MuJoCo's Stokes force on a sphere is 6 π β r v: each piece gets a sphere that touches
    nothing, of radius r = c m / (6 π β). The film's turning moment is below a thousandth.
    """

    rate_1_s: float

    def build(self, spec: mujoco.MjSpec, cable: Cable, truth: CableTruth) -> None:
        spec.option.viscosity = OIL_PA_S
        names = [f"segment_{index}" for index in range(truth.segments)] + ["endpoint"]
        for body in map(spec.body, names):
            _add_probe(body, self.rate_1_s * body.mass / (6 * np.pi * OIL_PA_S), 0.0)


def _add_probe(body: mujoco.MjsBody, radius_m: float, blunt_drag: float) -> None:
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[radius_m, 0, 0],
        pos=body.ipos,
        mass=0,
        contype=0,
        conaffinity=0,
        fluid_ellipsoid=1,
        fluid_coefs=[blunt_drag, 0, 0, 0, 0],
    )
