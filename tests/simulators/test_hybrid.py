"""What the soft rod must do: one Young's modulus bends and stretches it."""

from dataclasses import replace

import numpy as np
import pytest

from robotcast.measurements.measurement_set import Cable
from robotcast.simulators.mujoco_cables import ChainSettings, HybridSimulator, SegmentedSimulator
from robotcast.simulators.simulator import SimulatedCast, Simulator
from tests.simulators.conftest import (
    CABLE,
    STILL,
    apart,
    configured,
    frequency_hz,
    jerked,
    load_effect,
    nominal,
    path,
    resting,
    segmented,
)
from tests.simulators.conftest import PARAMETERS as SEGMENTED

GRAVITY_M_S2 = 9.81
AREA_M2 = np.pi * CABLE.radius_m**2
INERTIA_M4 = 0.25 * np.pi * CABLE.radius_m**4
DENSITY = CABLE.mass_kg / CABLE.length_m  # kg/m


def simulator(
    *effects: str, cable: Cable = CABLE, step_s: float = 0.003, damping_s: float = 0.02, **kw: int
) -> HybridSimulator:
    modulus = {"unit": "Pa", "lower": 1.0, "upper": 1e12, "nominal": 2e5, "scale": "log"}
    known = {name: SEGMENTED[name] for name in ("friction", "endpoint_mass_kg")}
    parameters = {"youngs_modulus_pa": modulus, **known}
    settings = ChainSettings(stretches=18, step_s=step_s, stretch_damping_s=damping_s, **kw)
    return HybridSimulator(cable, parameters, settings, [load_effect(name) for name in effects])


def settled(modulus_pa: float, sx: float, sy: float) -> np.ndarray:
    """Return where the end rests, (2,), on a tilted board without dry friction."""
    values = {"board_tilt.sx": sx, "board_tilt.sy": sy, "viscous_friction.c": 4.0}
    cast = SimulatedCast(STILL, np.array([15.0]))
    tilted = simulator("board_tilt", "viscous_friction")
    return path(tilted, cast, youngs_modulus_pa=modulus_pa, friction=0.0, **values)[0]


def test_it_sags_as_a_cantilever() -> None:
    """w L⁴ / 8 E I under its own weight and P L³ / 3 E I under the endpoint's."""
    modulus, slope = 1e8, 0.01
    pull, stiffness = GRAVITY_M_S2 * slope, modulus * INERTIA_M4
    own = pull * DENSITY * CABLE.length_m**4 / (8 * stiffness)
    expected = own + pull * 0.02 * CABLE.length_m**3 / (3 * stiffness)
    assert settled(modulus, 0.0, slope)[1] == pytest.approx(expected, rel=0.01)


def test_it_stretches_as_a_bar() -> None:
    """w L² / 2 E A under its own weight and P L / E A under the endpoint's."""
    modulus, slope = 1e5, 0.2
    stretch = settled(modulus, slope, 0.0)[0] - 0.6 - CABLE.length_m
    pull, stiffness = GRAVITY_M_S2 * slope, modulus * AREA_M2
    own = pull * DENSITY * CABLE.length_m**2 / (2 * stiffness)
    assert stretch == pytest.approx(own + pull * 0.02 * CABLE.length_m / stiffness, rel=0.01)


FIRST_RAD_S = 1.8751**2 * np.sqrt(1e-3 / DENSITY) / CABLE.length_m**2
"""Euler–Bernoulli: of a beam of E I = 1e-3 N m², clamped at the hand, free at the end."""
BARE = {"friction": 0.0, "endpoint_mass_kg": 0.0}
TIMES_S = np.arange(0.0, 6.0, 0.005)
LATE = TIMES_S > 1.0  # higher modes have died away


def swing(kind: Simulator, **values: float) -> np.ndarray:
    """Return how the end of a beam swings that was laid aside, (k,) [m]."""
    return path(kind, resting(TIMES_S, 0.02), **BARE, **values)[LATE, 1]


def test_both_chains_swing_at_the_frequency_of_a_clamped_beam() -> None:
    values = {"bending_stiffness_n_m2": 1e-3, "bending_damping_s": 0.002, "joint_friction_n_m": 0.0}
    rod = simulator(step_s=0.001, damping_s=0.002)
    rod_y, chain_y = (
        swing(rod, youngs_modulus_pa=1e-3 / INERTIA_M4),
        swing(segmented(step_s=0.001), **values),
    )
    expected = pytest.approx(FIRST_RAD_S / (2 * np.pi), rel=0.01)
    assert frequency_hz(rod_y, 0.005) == expected
    assert frequency_hz(chain_y, 0.005) == expected


def test_a_swing_dies_away_as_the_material_damps_it() -> None:
    """The amplitude of a mode falls as exp(−½ η ω² t): its damping is η times its stiffness."""
    own_s, added_s = 0.002, 0.1
    rod = simulator("bending_damping", step_s=0.001, damping_s=own_s)
    values = {"youngs_modulus_pa": 1e-3 / INERTIA_M4, "bending_damping.eta": added_s}
    y, t = swing(rod, **values), TIMES_S[LATE]
    rate = 0.5 * (own_s + added_s) * FIRST_RAD_S**2
    turning = np.sqrt(FIRST_RAD_S**2 - rate**2)
    basis = np.exp(-rate * t) * np.array([np.cos(turning * t), np.sin(turning * t)])
    fitted = np.linalg.lstsq(basis.T, y, rcond=None)[0]
    assert np.abs(basis.T @ fitted - y).max() < 0.03 * np.abs(y).max()


def test_it_springs_at_the_frequency_of_a_clamped_bar() -> None:
    """f₁ = √(EA/λ) / 4L: a bar that is clamped at the hand and free at the end."""
    rod = simulator(step_s=0.0005, damping_s=0.001)
    end = path(rod, jerked(np.arange(0.2, 3.9, 0.002)), youngs_modulus_pa=1e5, **BARE)[:, 0]
    expected = np.sqrt(1e5 * AREA_M2 / DENSITY) / (4 * CABLE.length_m)
    assert frequency_hz(end, 0.002) == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("added_s", [0.0, 0.1])
def test_a_rod_too_thin_to_stretch_moves_as_the_segmented_cable(
    casts: list[SimulatedCast], added_s: float
) -> None:
    """E A = 4 E I / r²: with the same bending a thinner rod stretches less."""
    thin, bending = replace(CABLE, radius_m=5e-4), 2e-4
    rod = simulator("bending_damping", cable=thin, step_s=0.001)
    chain = SegmentedSimulator(thin, SEGMENTED, ChainSettings(step_s=0.001))
    same = {
        "bending_stiffness_n_m2": bending,
        "bending_damping_s": 0.02 + added_s,
        "joint_friction_n_m": 0.0,
        "axial_stiffness_n": 4 * bending / thin.radius_m**2,
    }
    expected = chain.simulate(casts, nominal(chain, **same)).waypoints_m
    modulus = bending / (0.25 * np.pi * thin.radius_m**4)
    values = {"youngs_modulus_pa": modulus, "bending_damping.eta": added_s}
    miss = rod.simulate(casts, nominal(rod, **values)).waypoints_m - expected
    miss = np.linalg.norm(miss, axis=-1) / CABLE.length_m
    assert np.nanmedian(miss) < 0.002 and np.nanmax(miss) < 0.05


def of_moduli(*moduli_pa: float) -> np.ndarray:
    return np.vstack([nominal(simulator(), youngs_modulus_pa=modulus) for modulus in moduli_pa])


def test_halving_the_step_hardly_moves_the_end(casts: list[SimulatedCast]) -> None:
    """Second order in time, at every stiffness: 3 ms is within 0.5 % of cable length of 0.5 ms."""
    miss = apart(simulator(), simulator(step_s=0.0005), casts, of_moduli(2e4, 2e5, 5e6))
    assert (np.median(np.nanmean(miss, axis=-1), axis=1) < 0.005).all()


def test_six_segments_that_stretch_move_the_end_as_all_would(casts: list[SimulatedCast]) -> None:
    miss = apart(configured("hybrid"), simulator(), casts, of_moduli(2e4, 2e5, 2e6))
    assert (np.nanmean(miss, axis=(1, 2)) < 0.003).all()
