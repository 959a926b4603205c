"""What the soft rod must do: one Young's modulus bends and stretches it."""

import numpy as np
import pytest

from robotcast.casts.action import ToolMotion
from robotcast.measurements.measurement_set import Cable
from robotcast.simulators.mujoco_cables import ChainSettings, HybridSimulator, SegmentedSimulator
from robotcast.simulators.simulator import SimulatedCast
from tests.simulators.conftest import CABLE, configured, load_effect, nominal
from tests.simulators.conftest import PARAMETERS as SEGMENTED

GRAVITY_M_S2 = 9.81
STILL = ToolMotion(np.array([0.0, 20.0]), np.array([[0.6, 0.0, 0.0]] * 2))
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
    tilted = simulator("board_tilt", "viscous_friction")
    vector = nominal(
        tilted,
        youngs_modulus_pa=modulus_pa,
        friction=0.0,
        **{"board_tilt.sx": sx, "board_tilt.sy": sy, "viscous_friction.c": 4.0},
    )
    cast = SimulatedCast(STILL, np.array([15.0]))
    return tilted.simulate([cast], vector).waypoints_m[0, 0, 0]


def frequency_hz(signal: np.ndarray, period_s: float) -> float:
    """Return where the spectrum of a decaying swing is largest."""
    spectrum = np.abs(np.fft.rfft((signal - signal.mean()) * np.hanning(len(signal)), n=1 << 17))
    return np.fft.rfftfreq(1 << 17, period_s)[spectrum.argmax()]


def test_it_sags_as_a_cantilever() -> None:
    """w L⁴ / 8 E I under its own weight and P L³ / 3 E I under the endpoint's."""
    modulus, slope = 1e8, 0.01
    sag = settled(modulus, 0.0, slope)[1]
    pull = GRAVITY_M_S2 * slope
    stiffness = modulus * INERTIA_M4
    own = pull * DENSITY * CABLE.length_m**4 / (8 * stiffness)
    expected = own + pull * 0.02 * CABLE.length_m**3 / (3 * stiffness)
    assert sag == pytest.approx(expected, rel=0.01)


def test_it_stretches_as_a_bar() -> None:
    """w L² / 2 E A under its own weight and P L / E A under the endpoint's."""
    modulus, slope = 1e5, 0.2
    stretch = settled(modulus, slope, 0.0)[0] - 0.6 - CABLE.length_m
    pull, stiffness = GRAVITY_M_S2 * slope, modulus * AREA_M2
    own = pull * DENSITY * CABLE.length_m**2 / (2 * stiffness)
    assert stretch == pytest.approx(own + pull * 0.02 * CABLE.length_m / stiffness, rel=0.01)


def test_it_swings_at_the_frequency_of_a_clamped_beam() -> None:
    """f₁ = (1.8751²/2π) √(EI/λL⁴): Euler–Bernoulli, clamped at the hand, free at the end."""
    modulus = 1e-3 / INERTIA_M4
    rod = simulator(step_s=0.001, damping_s=0.002)
    vector = nominal(rod, youngs_modulus_pa=modulus, friction=0.0, endpoint_mass_kg=0.0)
    times = np.arange(0.0, 6.0, 0.005)
    aside = np.array([0.6 + np.cos(0.02), np.sin(0.02)])
    y = rod.simulate([SimulatedCast(STILL, times, aside)], vector).waypoints_m[0, 0, :, 1]
    expected = 1.8751**2 / (2 * np.pi) * np.sqrt(1e-3 / DENSITY) / CABLE.length_m**2
    late = times > 1.0  # higher modes have died away
    assert frequency_hz(y[late], 0.005) == pytest.approx(expected, rel=0.01)


def test_a_swing_dies_away_as_the_material_damps_it() -> None:
    """The amplitude of a mode falls as exp(−½ η ω² t): its damping is η times its stiffness."""
    modulus, own_s, added_s = 1e-3 / INERTIA_M4, 0.002, 0.1
    rod = simulator("bending_damping", step_s=0.001, damping_s=own_s)
    values = {"bending_damping.eta": added_s}
    vector = nominal(rod, youngs_modulus_pa=modulus, friction=0.0, endpoint_mass_kg=0.0, **values)
    times = np.arange(0.0, 6.0, 0.005)
    aside = np.array([0.6 + np.cos(0.02), np.sin(0.02)])
    y = rod.simulate([SimulatedCast(STILL, times, aside)], vector).waypoints_m[0, 0, :, 1]
    frequency = 1.8751**2 * np.sqrt(1e-3 / DENSITY) / CABLE.length_m**2  # ω₁
    rate = 0.5 * (own_s + added_s) * frequency**2
    swing = np.sqrt(frequency**2 - rate**2)
    late = times > 1.0  # higher modes have died away
    t = times[late]
    basis = np.exp(-rate * t) * np.array([np.cos(swing * t), np.sin(swing * t)])
    fitted = np.linalg.lstsq(basis.T, y[late], rcond=None)[0]
    assert np.abs(basis.T @ fitted - y[late]).max() < 0.03 * np.abs(y[late]).max()


def test_it_springs_at_the_frequency_of_a_clamped_bar() -> None:
    """f₁ = √(EA/λ) / 4L: a bar that is clamped at the hand and free at the end."""
    t = np.linspace(0.0, 4.0, 4001)
    x = 0.6 + 0.01 * (1 - np.cos(np.pi * np.clip(t / 0.05, 0, 1)))
    tool = ToolMotion(t, np.stack([x, 0 * t, 0 * t], axis=1))
    rod = simulator(step_s=0.0005, damping_s=0.001)
    vector = nominal(rod, youngs_modulus_pa=1e5, friction=0.0, endpoint_mass_kg=0.0)
    times = np.arange(0.2, 3.9, 0.002)
    end = rod.simulate([SimulatedCast(tool, times)], vector).waypoints_m[0, 0, :, 0]
    expected = np.sqrt(1e5 * AREA_M2 / DENSITY) / (4 * CABLE.length_m)
    assert frequency_hz(end, 0.002) == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("added_s", [0.0, 0.1])
def test_a_rod_too_thin_to_stretch_moves_as_the_segmented_cable(
    casts: list[SimulatedCast], added_s: float
) -> None:
    """E A = 4 E I / r²: with the same bending a thinner rod stretches less."""
    thin = Cable("thin", CABLE.length_m, CABLE.mass_kg, 5e-4, CABLE.endpoint_mass_kg)
    bending = 2e-4
    rod = simulator("bending_damping", cable=thin, step_s=0.001)
    chain = SegmentedSimulator(thin, SEGMENTED, ChainSettings(step_s=0.001))
    modulus = bending / (0.25 * np.pi * thin.radius_m**4)
    expected = chain.simulate(
        casts,
        nominal(
            chain,
            bending_stiffness_n_m2=bending,
            bending_damping_s=0.02 + added_s,
            joint_friction_n_m=0.0,
            axial_stiffness_n=4 * bending / thin.radius_m**2,
        ),
    )
    values = {"youngs_modulus_pa": modulus, "bending_damping.eta": added_s}
    got = rod.simulate(casts, nominal(rod, **values))
    miss = np.linalg.norm(got.waypoints_m - expected.waypoints_m, axis=-1)
    assert np.nanmedian(miss) < 0.002 * CABLE.length_m
    assert np.nanmax(miss) < 0.05 * CABLE.length_m


def test_halving_the_step_hardly_moves_the_end(casts: list[SimulatedCast]) -> None:
    """Second order in time, at every stiffness: 3 ms is within 0.5 % of cable length of 0.5 ms."""
    coarse, fine = simulator(), simulator(step_s=0.0005)
    vectors = np.vstack([nominal(coarse, youngs_modulus_pa=modulus) for modulus in (2e4, 2e5, 5e6)])
    difference = np.linalg.norm(
        coarse.simulate(casts, vectors).waypoints_m - fine.simulate(casts, vectors).waypoints_m,
        axis=-1,
    )
    assert (np.median(np.nanmean(difference, axis=-1), axis=1) < 0.005 * CABLE.length_m).all()


def test_six_segments_that_stretch_move_the_end_as_all_would(casts: list[SimulatedCast]) -> None:
    every, few = simulator(), configured("hybrid")
    vectors = np.vstack([nominal(few, youngs_modulus_pa=modulus) for modulus in (2e4, 2e5, 2e6)])
    miss = np.linalg.norm(
        few.simulate(casts, vectors).waypoints_m - every.simulate(casts, vectors).waypoints_m,
        axis=-1,
    )
    assert (np.nanmean(miss, axis=(1, 2)) < 0.003 * CABLE.length_m).all()


def test_a_material_damped_too_little_for_the_step_is_refused() -> None:
    with pytest.raises(ValueError, match="damping_s must be at least half of step_s"):
        simulator(damping_s=0.001)
