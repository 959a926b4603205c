"""Every hidden effect does to the virtual cable what its size says, against a closed form."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from robotcast.rigs.virtual.cable import CableRun, CableTruth, build_cable, compile_cable
from robotcast.rigs.virtual.mechanisms import (
    AIR_KG_M3,
    MECHANISMS,
    Disturbance,
    HiddenEffect,
    Pieces,
    acting,
)
from robotcast.rigs.virtual.rig import Eye, measure_cast, seen_places

HELD = np.array([0.6, 0.0, 0.0, 0.0, 0.0])
G = 9.81


@pytest.fixture
def flat(truth) -> CableTruth:
    """A cable that slides without bouncing: neither limp nor rigid, on a board that yields."""
    return replace(truth, friction=0.2, bending_stiffness_n_m2=0.03, contact_s=0.008)


def hidden(name: str, **numbers: float) -> HiddenEffect:
    return HiddenEffect(name, numbers)


def laid(cable, truth, *effects: HiddenEffect, airborne=False) -> CableRun:
    """A straight cable at rest."""
    spec = build_cable(cable, truth)
    for effect in acting(effects, "model"):
        effect(spec, cable, truth)
    if airborne:
        spec.option.gravity = [0, 0, 0]
    model = compile_cable(spec)
    tool = model.body("tool").id
    model.body_mass[tool] = model.body_inertia[tool] = 0
    return CableRun(model, np.zeros(truth.segments), HELD, Disturbance(effects, model, 0))


def slide(run: CableRun, velocity_m_s: tuple[float, float], seconds: float = 0.2) -> np.ndarray:
    """Let the whole cable slide, its held end free along x and y; return its acceleration (2,)."""
    run.settle()
    disturb, model, data = run.disturb, run.model, run.data
    model.dof_armature[:2] = 0
    data.qfrc_applied[:] = 0
    data.qvel[:] = 0
    data.qvel[:2] = velocity_m_s
    mujoco.mj_forward(model, data)
    before = mean_velocity(run)
    for _ in range(round(seconds / model.opt.timestep)):
        disturb(data)
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    return (mean_velocity(run) - before) / seconds


def mean_velocity(run: CableRun) -> np.ndarray:
    """Velocity of the common centre of mass, (2,)."""
    mujoco.mj_subtreeVel(run.model, run.data)
    return run.data.subtree_linvel[run.model.body("tool").id][:2].copy()


def pieces(place_m=((0.0, 0.0),), velocity_m_s=((0.0, 0.0),), t_s=0.0) -> Pieces:
    """Pieces of 1 kg at these places with these speeds."""
    place, velocity = np.broadcast_arrays(np.array(place_m, float), np.array(velocity_m_s, float))
    one = np.ones(len(place))
    return Pieces(place, velocity, one, one, one, t_s)


def pushed(run: CableRun, speed_m_s: float = 0.0) -> np.ndarray:
    """The whole force (2,) on a cable that moves along x at this speed."""
    run.data.qvel[0] = speed_m_s
    mujoco.mj_forward(run.model, run.data)
    run.disturb(run.data)
    return run.data.xfrc_applied[:, :2].sum(axis=0)


def total_mass(cable) -> float:
    return cable.mass_kg + cable.endpoint_mass_kg


def test_without_an_effect_the_cable_slides_to_rest_at_mu_g(cable, flat):
    along, across = slide(laid(cable, flat), (1.0, 0.0))
    assert along == pytest.approx(-flat.friction * G, rel=0.01)
    assert across == pytest.approx(0.0, abs=0.01)


def test_air_slows_by_half_rho_c_a_v_squared(cable, truth):
    side, ball = 2 * cable.radius_m * cable.length_m, np.pi * cable.radius_m**2
    for speed in (0.5, 2.0):
        force = -0.5 * AIR_KG_M3 * (7.0 * side + 0.5 * ball) * speed**2
        air = pushed(laid(cable, truth, hidden("air_drag", C=7.0)), speed)
        np.testing.assert_allclose(air, [force, 0.0], rtol=1e-6, atol=1e-12)


def test_air_slows_as_mujocos_own_medium_does(cable, truth):
    spec = build_cable(cable, truth)
    spec.option.density = AIR_KG_M3
    length = cable.length_m / truth.segments
    blunt = 0.5 * 7.0 * 2 * length / (np.pi * cable.radius_m)
    for index in range(truth.segments):
        geom = spec.body(f"segment_{index}").first_geom()
        geom.fluid_ellipsoid, geom.fluid_coefs = 1, [blunt, 0, 0, 0, 0]
    ball = spec.body("endpoint").first_geom()
    ball.fluid_ellipsoid, ball.fluid_coefs = 1, [0.25, 0, 0, 0, 0]
    model = compile_cable(spec)
    tool = model.body("tool").id
    model.body_mass[tool] = model.body_inertia[tool] = 0
    medium = CableRun(model, np.zeros(truth.segments), HELD)
    medium.data.qvel[0] = 2.0
    mujoco.mj_forward(model, medium.data)
    own = pushed(laid(cable, truth, hidden("air_drag", C=7.0)), 2.0)
    assert own[0] == pytest.approx(medium.data.qfrc_fluid[0], rel=1e-6)


def test_a_film_slows_every_piece_by_c_m_v(cable, truth):
    force = pushed(laid(cable, truth, hidden("viscous_friction", c=0.8)), 1.5)
    np.testing.assert_allclose(force, [-0.8 * total_mass(cable) * 1.5, 0.0], atol=1e-12)


def test_on_a_patch_as_wide_as_the_board_friction_is_one_plus_k_times_as_strong(cable, flat):
    along, _ = slide(
        laid(cable, flat, hidden("friction_patch", k=0.5, x0=0.9, y0=0.0, w=50.0)), (1.0, 0.0)
    )
    assert along == pytest.approx(-1.5 * flat.friction * G, rel=0.03)


def test_a_rough_end_adds_friction_under_the_end_alone(cable, flat):
    along, _ = slide(laid(cable, flat, hidden("endpoint_friction", k=0.8)), (1.0, 0.0))
    weighed = cable.mass_kg + 1.8 * cable.endpoint_mass_kg
    assert along == pytest.approx(-flat.friction * G * weighed / total_mass(cable), rel=0.02)


def test_the_pieces_are_where_the_cable_is_and_move_as_it_does(cable, truth, monkeypatch):
    seen = []
    monkeypatch.setitem(MECHANISMS, "spy", ("friction", lambda pieces: seen.append(pieces) or 1.0))
    run = laid(cable, truth, hidden("spy"))
    run.data.qvel[:] = np.random.default_rng(0).standard_normal(run.model.nv)
    mujoco.mj_forward(run.model, run.data)
    run.disturb(run.data)
    length = cable.length_m / truth.segments
    middles = HELD[0] + length * np.r_[np.arange(truth.segments) + 0.5, truth.segments]
    np.testing.assert_allclose(seen[0].place_m[:, 0], middles)
    for body in ("segment_7", "endpoint"):
        row = run.model.body(body).id - run.model.body("segment_0").id
        rates = np.zeros(6)
        kind = mujoco.mjtObj.mjOBJ_BODY
        mujoco.mj_objectVelocity(run.model, run.data, kind, run.model.body(body).id, rates, 0)
        np.testing.assert_allclose(seen[0].velocity_m_s[row], rates[3:5])


def test_grain_holds_across_the_cable_and_not_along_it(cable, flat):
    bare = replace(cable, endpoint_mass_kg=1e-6)
    along, _ = slide(laid(bare, flat, hidden("anisotropic_friction", a=0.5)), (1.0, 0.0))
    _, across = slide(laid(bare, flat, hidden("anisotropic_friction", a=0.5)), (0.0, 1.0))
    assert along == pytest.approx(-flat.friction * G, rel=0.05)
    assert across == pytest.approx(-1.5 * flat.friction * G, rel=0.05)


def test_a_curved_cable_without_weight_rests_as_an_arc(cable, truth):
    easy = replace(truth, hysteresis_n_m=0.0, bending_stiffness_n_m2=0.03)
    run = laid(cable, easy, hidden("resting_curvature", kappa=2.0), airborne=True)
    run.drive(np.tile(HELD, (10001, 1)), moving_s=10.0)
    bends = run.data.qpos[5::2]
    length = cable.length_m / truth.segments
    np.testing.assert_allclose(bends[1:], 2.0 * length, rtol=0.02)
    assert bends[0] == pytest.approx(length, rel=0.02)


@pytest.mark.rig
def test_the_log_shows_the_arm_and_not_what_the_grip_makes_of_it(quiet_rig, short_cast):
    honest = quiet_rig.simulate_truth(short_cast, 0)
    for effect in (hidden("tool_lag", tau=0.05), hidden("wrist_offset", beta=0.1)):
        loose = replace(quiet_rig, hidden=(effect,)).simulate_truth(short_cast, 0)
        t_s = honest.tool.t_s[honest.tool.t_s < 1.0]
        np.testing.assert_array_equal(loose.tool.at(t_s), honest.tool.at(t_s))
        assert np.abs(loose.cable.end_m[: len(t_s)] - honest.cable.end_m[: len(t_s)]).max() > 0.003


@pytest.mark.rig
def test_a_turned_grip_lets_the_cable_out_at_its_angle(quiet_rig, short_cast):
    rig = replace(quiet_rig, hidden=(hidden("wrist_offset", beta=0.1),))
    run, _ = rig.begin(short_cast, 0)
    assert run.held[3] == pytest.approx(0.1)


@pytest.mark.rig
def test_the_camera_sees_late_and_then_shifted(quiet_rig, short_cast):
    cable, stamps = quiet_rig.simulate_truth(short_cast, 0).cable, np.arange(12) * 0.1
    errs = hidden("camera_latency", tau=0.1), hidden("camera_offset", dx=0.01, dy=-0.02)
    late = seen_places(replace(quiet_rig, hidden=errs), cable, stamps)[1:]
    plain = seen_places(quiet_rig, cable, stamps)[:-1]
    np.testing.assert_allclose(late - plain, [[0.01, -0.02]] * 11, atol=1e-12)


@pytest.mark.rig
def test_tracked_waypoints_carry_the_eyes_noise_and_the_same_number_the_same_bytes(rig, short_cast):
    eye, blind = Eye(noise_m=0.002), Eye(noise_m=0.0)
    trial, true = (measure_cast(rig, e, short_cast, 3, 7) for e in (eye, blind))
    wrong = trial.waypoints_m - true.waypoints_m
    assert wrong.std() == pytest.approx(0.002, rel=0.35)
    again = measure_cast(rig, eye, short_cast, 3, 7)
    np.testing.assert_array_equal(trial.waypoints_m, again.waypoints_m)
    assert (trial.trial, trial.action_id, trial.action) == (3, 7, short_cast.action)
    np.testing.assert_allclose(np.diff(trial.waypoints_s), 0.1)


def test_a_band_pulls_the_end_by_its_stiffness_times_the_distance(cable, truth):
    run = laid(cable, truth, hidden("rubber_band", stiffness=0.1, x0=1.0, y0=0.3))
    mujoco.mj_forward(run.model, run.data)
    end = run.data.xpos[run.model.body("endpoint").id]
    away = np.array([1.0, 0.3]) - end[:2]
    np.testing.assert_allclose(run.data.qfrc_spring[:2], 0.1 * away, rtol=1e-6)


def test_syrup_holds_back_only_what_is_in_it(cable, truth):
    run = laid(
        cable, truth, hidden("sticky_zone", c=2.0, x0=0.6 + cable.length_m, y0=0.0, radius=0.01)
    )
    expected = [-2.0 * cable.endpoint_mass_kg, 0.0]
    np.testing.assert_allclose(pushed(run, 1.0), expected, atol=1e-12)


def test_a_fan_blows_over_its_part_of_the_board(cable, truth):
    for beyond, share in ((-0.1, 1.0), (0.1, 0.0)):
        run = laid(
            cable, truth, hidden("draught", a=0.4, heading=np.pi / 2, from_y=beyond, side=1.0)
        )
        expected = [0.0, share * 0.4 * total_mass(cable)]
        np.testing.assert_allclose(pushed(run), expected, atol=1e-12)


def test_a_swinging_end_keeps_the_mass_and_the_end_that_is_filmed(cable, truth):
    run = laid(cable, truth, hidden("swinging_end", share=0.5, arm=0.04))
    chain = run.model.body_subtreemass[run.model.body("segment_0").id]
    assert chain == pytest.approx(total_mass(cable))
    end = run.drive(np.tile(HELD, (3, 1)), moving_s=1.0).end_m[0]
    assert end[0] == pytest.approx(HELD[0] + cable.length_m)


def test_a_warming_board_changes_in_the_course_of_the_cast():
    board = hidden("warming_board", k=0.5, time=2.0)
    for t_s, factor in ((-0.5, 1.0), (0.0, 1.0), (2.0, 1.5 - 0.5 / np.e)):
        np.testing.assert_allclose(board(pieces(t_s=t_s)), factor)


@pytest.mark.rig
def test_a_rig_with_an_effect_is_another_rig(rig):
    assert (
        replace(rig, hidden=(hidden("viscous_friction", c=0.5),)).facts()["made"]
        != rig.facts()["made"]
    )


def test_an_effect_with_other_numbers_than_its_mechanism_takes_is_refused():
    with pytest.raises(ValueError, match=r"wind is none of air_drag, .*wrist_offset"):
        hidden("wind", k=1.0)
    with pytest.raises(ValueError, match="air_drag takes C, got k"):
        hidden("air_drag", k=1.0)
