"""What the planar chain must do whatever its parameters."""

import numpy as np
import pytest
from scipy.optimize import brentq

from robotcast.casts.action import ToolMotion
from robotcast.simulators.simulator import SimulatedCast
from tests.simulators.conftest import (
    CABLE,
    apart,
    frequency_hz,
    jerked,
    make_casts,
    nominal,
    path,
    resting,
    segmented,
)


def test_a_cable_behind_a_still_tool_stays_where_it_lies() -> None:
    seen = path(segmented(), resting(np.array([0.0, 2.0])))
    np.testing.assert_allclose(seen, [[1.23, 0.0]] * 2, atol=1e-6)


def test_a_leaning_cable_starts_where_it_was_seen() -> None:
    stub, aside = 0.25 * CABLE.length_m / 18, np.array([np.cos(0.05), np.sin(0.05)])
    end = np.array([0.6 + stub, 0]) + (CABLE.length_m - stub) * aside
    seen = path(segmented(), resting(np.array([0.0]), 0.05))
    np.testing.assert_allclose(seen[0], end, atol=1e-6)


def test_an_endpoint_bounces_on_the_cable_as_on_a_spring() -> None:
    """f = √(EA/mL) / 2π: a mass on a cable that weighs nothing, jerked along it."""
    simulator = segmented(step_s=0.0005, stretch_damping_s=0.0005)
    values = {"friction": 0.0, "cable_mass_kg": 1e-6, "axial_stiffness_n": 30.0}
    end = path(simulator, jerked(np.arange(0.2, 2.0, 0.002)), **values)[:, 0]
    expected = np.sqrt(30.0 / (0.02 * CABLE.length_m)) / (2 * np.pi)
    assert frequency_hz(end, 0.002) == pytest.approx(expected, rel=0.01)


def test_three_segments_that_stretch_move_the_end_as_all_would(casts: list[SimulatedCast]) -> None:
    """A cable that hardly stretches, for comparison, is further off."""
    few, every = segmented(), segmented(stretches=18)
    vectors = np.vstack([nominal(few), nominal(few, axial_stiffness_n=1e4)])
    expected = every.simulate(casts, vectors[:1]).waypoints_m
    miss = np.linalg.norm(few.simulate(casts, vectors).waypoints_m - expected, axis=-1)
    stretching, rigid = np.nanmean(miss, axis=(1, 2)) / CABLE.length_m
    assert stretching < 0.002 < rigid


@pytest.mark.parametrize(("friction", "omega"), [(0.3, 2.0), (0.4, 2.0 * (4 / 3) ** 0.5)])
def test_a_mass_dragged_round_keeps_the_circle_that_coulomb_and_centripetal_force_allow(
    friction: float, omega: float
) -> None:
    """A light cable pulls the mass along its velocity by μmg and inwards by mΩ²r.

    So it stands at φ = atan(Ω²r/μg) inwards of the velocity, and the held end, on a circle of
    radius R, is at R² = (r − L sin φ)² + (L cos φ)².
    """
    held_m, t = 0.6, np.linspace(0.0, 16.0, 4001)
    angle = omega * (t + 2.0 * (np.exp(-t / 2.0) - 1))
    circle = held_m * np.stack([np.cos(angle), np.sin(angle)])
    tool = ToolMotion(t, np.stack([*circle, angle - np.pi / 2], axis=1))
    values = {"cable_mass_kg": 1e-3, "joint_friction_n_m": 0.0, "bending_stiffness_n_m2": 2e-6}
    cast = SimulatedCast(tool, np.arange(12.0, 15.9, 0.1))
    seen = path(segmented(step_s=0.002), cast, friction=friction, **values)

    def excess(r_m: float) -> float:
        phi = np.arctan2(omega**2 * r_m, friction * 9.81)
        inward, along = CABLE.length_m * np.sin(phi), CABLE.length_m * np.cos(phi)
        return (r_m - inward) ** 2 + along**2 - held_m**2

    radius_m = np.linalg.norm(seen, axis=1).mean()
    assert radius_m == pytest.approx(brentq(excess, 0.6, 1.3), rel=0.02)


@pytest.mark.parametrize(
    ("coarse", "fine", "most"),
    [
        ({}, {"step_s": 0.0005}, 0.003),
        ({"step_s": 0.001}, {"step_s": 0.001, "segments": 54}, 0.01),
    ],
)
def test_finer_steps_and_segments_hardly_move_the_end(
    casts: list[SimulatedCast], coarse: dict, fine: dict, most: float
) -> None:
    """Second order in time and in length: parts of cable length, for most casts."""
    simulator = segmented(**coarse)
    miss = apart(simulator, segmented(**fine), casts, nominal(simulator))[0]
    assert np.nanmedian(np.nanmean(miss, axis=-1)) < most


def test_a_diverged_run_is_marked_and_leaves_the_others_alone(casts: list[SimulatedCast]) -> None:
    """Of casts of different length, waypoints end in NaN."""
    simulator = segmented()
    sane = nominal(simulator)
    wild = nominal(simulator, bending_stiffness_n_m2=10.0, bending_damping_s=0.0)
    prediction = simulator.simulate(casts, np.vstack([sane, wild]))
    assert not prediction.diverged[0].any()
    assert prediction.diverged[1].all()
    assert np.isnan(prediction.waypoints_m[1]).all()
    alone = simulator.simulate(casts, sane).waypoints_m
    np.testing.assert_array_equal(prediction.waypoints_m[0], alone[0])
    for row, cast in zip(alone[0], casts, strict=True):
        k = len(cast.waypoints_s)
        assert np.isfinite(row[:k]).all() and np.isnan(row[k:]).all()


def test_a_run_that_diverges_is_taken_again_at_half_the_step() -> None:
    simulator, finer = segmented(), segmented(step_s=0.002)
    whips = make_casts(20, slowest_m_s=1.4, fastest_m_s=2.2)
    values = {"friction": 0.1, "endpoint_mass_kg": 0.005, "bending_damping_s": 0.01}
    springy = nominal(simulator, bending_stiffness_n_m2=1e-4, **values)
    once = simulator.simulate(whips, springy, retry=False)
    again = simulator.simulate(whips, springy)
    assert once.diverged.any() and not again.diverged.any()
    at_half = finer.simulate(whips, springy).waypoints_m
    expected = np.where(once.diverged[..., None, None], at_half, once.waypoints_m)
    np.testing.assert_array_equal(again.waypoints_m, expected)


def test_a_vector_of_the_wrong_length_is_refused(casts: list[SimulatedCast]) -> None:
    with pytest.raises(ValueError, match="expected 8 parameters a vector, got 2"):
        segmented().simulate(casts, np.ones((1, 2)))
