"""What the planar chain must do whatever its parameters."""

import numpy as np
import pytest
from scipy.optimize import brentq

from robotcast.casts.action import ToolMotion
from robotcast.simulators.simulator import SimulatedCast
from tests.simulators.conftest import CABLE, MakeSimulator, nominal

STILL = ToolMotion(np.array([0.0, 10.0]), np.array([[0.6, 0.0, 0.0]] * 2))


def resting(waypoints_s: np.ndarray, lean_rad: float = 0.0) -> SimulatedCast:
    """A cable that lies `lean_rad` aside of a tool that does not move."""
    end = [0.6 + np.cos(lean_rad), np.sin(lean_rad)]
    return SimulatedCast(STILL, waypoints_s, np.array(end))


def test_a_cable_behind_a_still_tool_stays_where_it_lies(make_simulator: MakeSimulator) -> None:
    simulator = make_simulator()
    prediction = simulator.simulate([resting(np.array([0.0, 2.0]))], nominal(simulator))
    np.testing.assert_allclose(prediction.waypoints_m[0, 0], [[1.23, 0.0]] * 2, atol=1e-6)


def test_a_leaning_cable_starts_where_it_was_seen(make_simulator: MakeSimulator) -> None:
    simulator = make_simulator()
    prediction = simulator.simulate([resting(np.array([0.0]), 0.05)], nominal(simulator))
    stub = 0.25 * CABLE.length_m / 18
    end = np.array([0.6 + stub, 0]) + (CABLE.length_m - stub) * np.array(
        [np.cos(0.05), np.sin(0.05)]
    )
    np.testing.assert_allclose(prediction.waypoints_m[0, 0, 0], end, atol=1e-6)


def test_a_frictionless_cable_swings_at_the_frequency_of_a_clamped_beam(
    make_simulator: MakeSimulator,
) -> None:
    """f₁ = (1.8751²/2π) √(EI/λL⁴): Euler–Bernoulli, clamped at the hand, free at the end."""
    stiffness = 1e-3
    simulator = make_simulator(step_s=0.001)
    vector = nominal(
        simulator,
        friction=0.0,
        endpoint_mass_kg=0.0,
        joint_friction_n_m=0.0,
        bending_stiffness_n_m2=stiffness,
        bending_damping_s=0.002,
    )
    times = np.arange(0.0, 6.0, 0.005)
    y = simulator.simulate([resting(times, 0.02)], vector).waypoints_m[0, 0, :, 1]
    late = times > 1.0  # higher modes have died away
    spectrum = np.abs(np.fft.rfft(y[late] * np.hanning(late.sum()), n=1 << 17))
    frequency = np.fft.rfftfreq(1 << 17, 0.005)[spectrum.argmax()]
    density = CABLE.mass_kg / CABLE.length_m
    expected = 1.8751**2 / (2 * np.pi) * np.sqrt(stiffness / density) / CABLE.length_m**2
    assert frequency == pytest.approx(expected, rel=0.01)


def test_an_endpoint_bounces_on_the_cable_as_on_a_spring(make_simulator: MakeSimulator) -> None:
    """f = √(EA/mL) / 2π: a mass on a cable that weighs nothing, jerked along it."""
    t = np.linspace(0.0, 2.0, 2001)
    x = 0.6 + 0.01 * (1 - np.cos(np.pi * np.clip(t / 0.05, 0, 1)))
    jerk = SimulatedCast(
        ToolMotion(t, np.stack([x, 0 * t, 0 * t], axis=1)), np.arange(0.2, 2.0, 0.002)
    )
    simulator = make_simulator(step_s=0.0005, stretch_damping_s=0.0005)
    vector = nominal(simulator, friction=0.0, cable_mass_kg=1e-6, axial_stiffness_n=30.0)
    end = simulator.simulate([jerk], vector).waypoints_m[0, 0, :, 0]
    spectrum = np.abs(np.fft.rfft((end - end.mean()) * np.hanning(len(end)), n=1 << 17))
    frequency = np.fft.rfftfreq(1 << 17, 0.002)[spectrum.argmax()]
    expected = np.sqrt(30.0 / (0.02 * CABLE.length_m)) / (2 * np.pi)
    assert frequency == pytest.approx(expected, rel=0.01)


def test_three_segments_that_stretch_move_the_end_as_all_would(
    make_simulator: MakeSimulator, casts: list[SimulatedCast]
) -> None:
    """A cable that hardly stretches, for comparison, is further off."""
    few, every = make_simulator(), make_simulator(stretches=18)
    vectors = np.vstack([nominal(few), nominal(few, axial_stiffness_n=1e4)])
    expected = every.simulate(casts, vectors[:1]).waypoints_m
    miss = np.linalg.norm(few.simulate(casts, vectors).waypoints_m - expected, axis=-1)
    stretching, rigid = np.nanmean(miss, axis=(1, 2)) / CABLE.length_m
    assert stretching < 0.002 < rigid


@pytest.mark.parametrize(("friction", "omega"), [(0.3, 2.0), (0.4, 2.0 * (4 / 3) ** 0.5)])
def test_a_mass_dragged_round_keeps_the_circle_that_coulomb_and_centripetal_force_allow(
    make_simulator: MakeSimulator, friction: float, omega: float
) -> None:
    """A light cable pulls the mass along its velocity by μmg and inwards by mΩ²r.

    So it stands at φ = atan(Ω²r/μg) inwards of the velocity, and the held end, on a circle of
    radius R, is at R² = (r − L sin φ)² + (L cos φ)².
    """
    held_m = 0.6
    simulator = make_simulator(step_s=0.002)
    t = np.linspace(0.0, 16.0, 4001)
    angle = omega * (t + 2.0 * (np.exp(-t / 2.0) - 1))
    circle = held_m * np.stack([np.cos(angle), np.sin(angle)])
    tool = ToolMotion(t, np.stack([*circle, angle - np.pi / 2], axis=1))
    vector = nominal(
        simulator,
        friction=friction,
        cable_mass_kg=1e-3,
        joint_friction_n_m=0.0,
        bending_stiffness_n_m2=2e-6,
    )
    cast = SimulatedCast(tool, np.arange(12.0, 15.9, 0.1))
    radius = np.linalg.norm(simulator.simulate([cast], vector).waypoints_m[0, 0], axis=1)

    def excess(r_m: float) -> float:
        phi = np.arctan2(omega**2 * r_m, friction * 9.81)
        inward, along = CABLE.length_m * np.sin(phi), CABLE.length_m * np.cos(phi)
        return (r_m - inward) ** 2 + along**2 - held_m**2

    assert radius.mean() == pytest.approx(brentq(excess, 0.6, 1.3), rel=0.02)


def test_halving_the_step_hardly_moves_the_end(
    make_simulator: MakeSimulator, casts: list[SimulatedCast]
) -> None:
    """Second order in time: 4 ms is within 0.3 % of cable length of 0.5 ms for most casts."""
    coarse, fine = make_simulator(), make_simulator(step_s=0.0005)
    difference = np.linalg.norm(
        coarse.simulate(casts, nominal(coarse)).waypoints_m
        - fine.simulate(casts, nominal(fine)).waypoints_m,
        axis=-1,
    )
    assert np.nanmedian(np.nanmean(difference[0], axis=-1)) < 0.003 * CABLE.length_m


def test_more_segments_hardly_move_the_end(
    make_simulator: MakeSimulator, casts: list[SimulatedCast]
) -> None:
    """Second order in length: 18 segments are within 1 % of 54 for most casts."""
    coarse, fine = make_simulator(step_s=0.001), make_simulator(step_s=0.001, segments=54)
    difference = np.linalg.norm(
        coarse.simulate(casts, nominal(coarse)).waypoints_m
        - fine.simulate(casts, nominal(fine)).waypoints_m,
        axis=-1,
    )
    assert np.nanmedian(np.nanmean(difference[0], axis=-1)) < 0.01 * CABLE.length_m


def test_a_diverged_run_is_marked_and_leaves_the_others_alone(
    make_simulator: MakeSimulator, casts: list[SimulatedCast]
) -> None:
    simulator = make_simulator()
    sane = nominal(simulator)
    wild = nominal(simulator, bending_stiffness_n_m2=10.0, bending_damping_s=0.0)
    prediction = simulator.simulate(casts, np.vstack([sane, wild]))
    assert not prediction.diverged[0].any()
    assert prediction.diverged[1].all()
    assert np.isnan(prediction.waypoints_m[1]).all()
    alone = simulator.simulate(casts, sane).waypoints_m
    np.testing.assert_array_equal(prediction.waypoints_m[0], alone[0])


def test_a_run_that_diverges_is_taken_again_at_half_the_step(
    make_simulator: MakeSimulator, fast_casts: list[SimulatedCast]
) -> None:
    simulator, finer = make_simulator(), make_simulator(step_s=0.002)
    springy = nominal(
        simulator,
        friction=0.1,
        endpoint_mass_kg=0.005,
        bending_stiffness_n_m2=1e-4,
        bending_damping_s=0.01,
    )
    once = simulator.simulate(fast_casts, springy, retry=False)
    again = simulator.simulate(fast_casts, springy)
    assert once.diverged.any() and not again.diverged.any()
    expected = np.where(
        once.diverged[..., None, None],
        finer.simulate(fast_casts, springy).waypoints_m,
        once.waypoints_m,
    )
    np.testing.assert_array_equal(again.waypoints_m, expected)


def test_waypoints_of_casts_of_different_length_end_in_nan(
    make_simulator: MakeSimulator, casts: list[SimulatedCast]
) -> None:
    simulator = make_simulator()
    waypoints = simulator.simulate(casts, nominal(simulator)).waypoints_m[0]
    for row, cast in zip(waypoints, casts, strict=True):
        k = len(cast.waypoints_s)
        assert np.isfinite(row[:k]).all()
        assert np.isnan(row[k:]).all()


def test_a_vector_of_the_wrong_length_is_refused(
    make_simulator: MakeSimulator, casts: list[SimulatedCast]
) -> None:
    with pytest.raises(ValueError, match="expected 8 parameters a vector, got 2"):
        make_simulator().simulate(casts, np.ones((1, 2)))
