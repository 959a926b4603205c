from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hydra.utils import instantiate
from omegaconf import OmegaConf

from robotcast.casts.action import ToolMotion
from robotcast.casts.plan import PlanLimits
from robotcast.effects.effect import Effect, Numbers
from robotcast.measurements.measurement_set import Cable
from robotcast.simulators.mujoco_cables import ChainSettings, SegmentedSimulator
from robotcast.simulators.simulator import SimulatedCast, Simulator
from tests.good_casts import mirrored_tool, plan_cast

CONFIGURATION = Path(__file__).resolve().parents[2] / "conf"
EFFECTS = OmegaConf.load(CONFIGURATION / "effects.yaml").effects
CABLE = Cable("cable", 0.63, 0.008, 0.0045, 0.02)
_WIDE = {  # unit, bounds and nominal value
    "friction": ("1", 0.0, 1.0, 0.28),
    "cable_mass_kg": ("kg", 1e-9, 1.0, 0.008),
    "endpoint_mass_kg": ("kg", 0.0, 1.0, 0.02),
    "joint_friction_n_m": ("N m", 0.0, 1.0, 1e-6),
    "bending_stiffness_n_m2": ("N m²", 0.0, 10.0, 3e-5),
    "bending_damping_s": ("s", 0.0, 10.0, 0.15),
    "grip_stiffness": ("1", 0.0, 10.0, 1.0),
    "axial_stiffness_n": ("N", 1.0, 1e4, 300.0),
}
_NUMBERS = ("unit", "lower", "upper", "nominal")
PARAMETERS: Numbers = {n: dict(zip(_NUMBERS, wide, strict=True)) for n, wide in _WIDE.items()}

STILL = ToolMotion(np.array([0.0, 20.0]), np.array([[0.6, 0.0, 0.0]] * 2))


def segmented(**settings: Any) -> SegmentedSimulator:
    """Make the simulator with wide bounds and some settings replaced."""
    return SegmentedSimulator(CABLE, PARAMETERS, ChainSettings(**settings))


@pytest.fixture(scope="session")
def casts() -> list[SimulatedCast]:
    """Casts of several speeds and shapes, watched every 100 ms until they rest."""
    return make_casts(6, slowest_m_s=0.7, fastest_m_s=1.4)


def resting(waypoints_s: np.ndarray, lean_rad: float = 0.0) -> SimulatedCast:
    """A cable that lies `lean_rad` aside of a tool that does not move."""
    end = [0.6 + np.cos(lean_rad), np.sin(lean_rad)]
    return SimulatedCast(STILL, waypoints_s, np.array(end))


def jerked(waypoints_s: np.ndarray) -> SimulatedCast:
    """A cable that the tool jerks by 2 cm along it."""
    t = np.linspace(0.0, waypoints_s[-1] + 0.1, 4001)
    x = 0.6 + 0.01 * (1 - np.cos(np.pi * np.clip(t / 0.05, 0, 1)))
    return SimulatedCast(ToolMotion(t, np.stack([x, 0 * t, 0 * t], axis=1)), waypoints_s)


def path(simulator: Simulator, cast: SimulatedCast, **changed: float) -> np.ndarray:
    """Return the waypoints (k, 2) of one cast, with some values changed."""
    return simulator.simulate([cast], nominal(simulator, **changed)).waypoints_m[0, 0]


def apart(
    one: Simulator, other: Simulator, casts: list[SimulatedCast], vectors: np.ndarray
) -> np.ndarray:
    """Return how far waypoints of two simulators lie apart in parts of cable length, (n, m, k)."""
    found = (simulator.simulate(casts, vectors).waypoints_m for simulator in (one, other))
    return np.linalg.norm(np.subtract(*found), axis=-1) / CABLE.length_m


def displacements(
    kind: str, casts: list[SimulatedCast], same: dict[str, float], slope: float, **settings: float
) -> np.ndarray:
    """Return how far boards tilted four ways move the waypoints of one cable, (4, n, k, 2) [m]."""
    simulator = configured(kind, "board_tilt", **settings)
    ways = ((0.0, 0.0), (slope, 0.0), (0.0, slope), (-slope, 0.0), (0.0, -slope))
    vectors = [
        nominal(simulator, **same, **{"board_tilt.sx": x, "board_tilt.sy": y}) for x, y in ways
    ]
    level, *tilted = simulator.simulate(casts, np.vstack(vectors)).waypoints_m
    return np.array(tilted) - level


def relative_miss(found: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """Return how much of each expected displacement is missed, (4,)."""
    squares = (np.nansum(part**2, axis=(1, 2, 3)) for part in (found - expected, expected))
    return np.sqrt(np.divide(*squares))


def frequency_hz(signal: np.ndarray, period_s: float) -> float:
    """Return where the spectrum of a decaying swing is largest."""
    spectrum = np.abs(np.fft.rfft((signal - signal.mean()) * np.hanning(len(signal)), n=1 << 17))
    return np.fft.rfftfreq(1 << 17, period_s)[spectrum.argmax()]


def make_casts(n: int, *, slowest_m_s: float, fastest_m_s: float) -> list[SimulatedCast]:
    random = np.random.default_rng(3)
    made = []
    for _ in range(n):
        planned = plan_cast(
            random.uniform(0.3, 1.0),
            random.uniform(-1.1, -0.3),
            random.uniform(0.55, 0.8),
            random.uniform(0.0, 1.2),
            random.uniform(slowest_m_s, fastest_m_s),
            r0_m=0.6,
            limits=PlanLimits(),
        )
        made.append(SimulatedCast(planned.tool, np.arange(0.0, planned.end_s + 1.0, 0.1)))
    return made


def nominal(simulator: Simulator, **changed: float) -> np.ndarray:
    """Return the simulator's nominal vector with some values changed, (1, n)."""
    values = {p.name: p.nominal for p in simulator.parameters} | changed
    return np.array([list(values.values())])


def mirrored(cast: SimulatedCast) -> SimulatedCast:
    return replace(cast, tool=mirrored_tool(cast.tool))


def load_effect(name: str) -> Effect:
    """Return the effect that conf/effects.yaml names."""
    return instantiate(EFFECTS[name], name=name, _convert_="all")


def configured(name: str, *effects: str, **settings: float) -> Simulator:
    """Return the simulator that conf/simulator/ names, of `CABLE`, with some settings replaced."""
    model = OmegaConf.load(CONFIGURATION / "simulator" / f"{name}.yaml").model
    model = OmegaConf.merge(model, {"settings": settings})
    return instantiate(model, cable=CABLE, effects=[load_effect(effect) for effect in effects])
