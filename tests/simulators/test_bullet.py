"""What PyBullet's cable must do beside what every simulator must."""

import numpy as np
import pytest

from robotcast.casts.action import ToolMotion
from robotcast.effects.effect import ActiveEffects
from robotcast.simulators.bullet import (
    BulletRun,
    BulletSettings,
    fastest_frequency,
    physics_client,
    spring_torques,
)
from robotcast.simulators.simulator import SimulatedCast
from tests.simulators.conftest import (
    CABLE,
    configured,
    displacements,
    mirrored,
    nominal,
    relative_miss,
)


def sweep(way_m: float) -> SimulatedCast:
    """Return a cast whose hand moves sideways in 1.2 s and waits until the cable rests."""
    t = np.linspace(0.0, 1.2, 151)
    y = 0.5 * way_m * (1 - np.cos(np.pi * t / 1.2))
    tool = ToolMotion(t, np.stack([np.full_like(t, 0.6), y, 0 * t], axis=1))
    return SimulatedCast(tool, np.arange(0.0, 1.8, 0.1))


def test_a_tilt_moves_the_same_cable_as_it_does_in_the_segmented_simulator() -> None:
    """Rough enough not to roll, hard to twist, and hardly creeping where it rests."""
    chain = {"bending_damping_s": 0.005, "joint_friction_n_m": 1e-7}
    fine = {"step_s": 0.001, "sliding_speed_m_s": 0.002}
    capsules = {"twist_stiffness_n_m2": 1e-4, "rolling_friction_m": 1e-2}
    capsules |= {"spinning_friction_m": 1e-5, "linear_damping_per_s": 0.0}
    capsules |= {"angular_damping_per_s": 2.3}
    bending = {"bending_stiffness_n_m2": 1e-4}
    expected = displacements("segmented", [sweep(0.5)], chain | bending, 0.05, **fine)
    found = displacements("bullet", [sweep(0.5)], capsules | bending, 0.05)
    assert (relative_miss(found, expected) < 0.1).all()


def test_neither_processes_nor_what_ran_before_in_one_change_a_bit() -> None:
    """One process runs both cables one after the other, two run one each."""
    vectors = [nominal(configured("bullet"), dynamic_friction=mu) for mu in (0.2, 0.5)]
    expected, got = (
        configured("bullet", processes=n).simulate([sweep(0.4)], np.vstack(vectors)).waypoints_m
        for n in (1, 2)
    )
    np.testing.assert_array_equal(got, expected)


def test_a_mirrored_cast_mirrors() -> None:
    """A whip magnifies what the order of Bullet's solver leaves to 0.2 mm."""
    simulator = configured("bullet")
    here, there = simulator.simulate(
        [sweep(0.5), mirrored(sweep(0.5))], nominal(simulator)
    ).waypoints_m[0]
    np.testing.assert_allclose(there, here * [1.0, -1.0], atol=1e-6)


def test_friction_is_a_cone_and_the_plane_carries_the_weight() -> None:
    """Each contact rubs with at most μ times what it carries, whichever way it slides."""
    vector = nominal(configured("bullet"), dynamic_friction=0.3)
    pose = np.array([[0.6, 0.0, 0.0]])
    nothing = ActiveEffects((), np.zeros((1, 0)))
    run = BulletRun(CABLE, BulletSettings(), 0.004, pose, np.zeros(1), vector, nothing)
    carried = []
    for step in range(150):
        pose = pose + np.array([-0.001, 0.002 * min(1.0, step / 25), 0.0])
        run.step(run.state(), pose)
        contacts = np.array([[c[9], c[10], c[12]] for c in physics_client().getContactPoints()])
        normal, *rubbing = contacts.T
        assert (np.hypot(*rubbing) <= 0.3 * normal * (1 + 1e-6) + 1e-9).all()
        carried.append(normal.sum())
    weight = 9.81 * (CABLE.mass_kg * (1 - 0.25 / 18) + CABLE.endpoint_mass_kg)
    assert np.mean(carried[50:]) == pytest.approx(weight, rel=0.02)


def test_springs_push_back_what_is_bent_and_what_is_twisted() -> None:
    """k φ about the normal of the bend, c τ along the axis, the sums zero."""
    half = 0.1
    bent = [0.0, 0.0, np.sin(half), np.cos(half)]
    twisted = [np.sin(half), 0.0, 0.0, np.cos(half)]
    for turned, expected, bend in (
        (bent, [0.0, 0.0, -3.0 * 2 * half], 2 * half),
        (twisted, [-5.0 * 2 * half, 0.0, 0.0], 0.0),
    ):
        torques, bends = np.empty((2, 3)), np.empty(1)
        quaternions = np.array([[0.0, 0.0, 0.0, 1.0], turned])
        spring_torques(quaternions, np.array([3.0]), np.array([5.0]), torques, bends)
        np.testing.assert_allclose(torques, [[-x for x in expected], expected], atol=1e-12)
        assert bends[0] == pytest.approx(bend)


def test_the_fastest_frequency_of_one_bar_on_a_hinge() -> None:
    """ω² = k / (m l²/3 + m r²/4 + M l²); about its axis ω² = 2 c / m r²."""
    m, length, endpoint, r = 0.01, 0.1, 0.02, 0.004
    args = (np.array([length]), np.array([m]), endpoint, r)
    inertia = m * (length**2 / 3 + r**2 / 4) + endpoint * length**2
    one, none = np.array([0.5]), np.zeros(1)
    assert fastest_frequency(*args, one, none) == pytest.approx(np.sqrt(0.5 / inertia))
    assert fastest_frequency(*args, none, one) == pytest.approx(np.sqrt(0.5 / (0.5 * m * r**2)))
