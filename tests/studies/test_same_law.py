"""Sizes can be compared: an effect hides on the rig by the law that the library names.

The rig's effects and the library's share no code; here both are asked about one cable. Where
they differ (`same_law` is False), a size on the rig is none that a diagnosis could find.
"""

from collections.abc import Mapping
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hydra.utils import instantiate
from omegaconf import OmegaConf

from robotcast.casts.action import Action
from robotcast.casts.curves import PlanLimits
from robotcast.casts.plan import PlannedCast, plan_action
from robotcast.effects.effect import CableMotion, Effect
from robotcast.rigs.virtual.cable import CableTruth, build_cable
from robotcast.rigs.virtual.hiding import LIBRARY, make_effect
from robotcast.rigs.virtual.mechanisms import HiddenEffect, Pieces, acting
from tests.rigs.small_rig import CABLE, TRUTH
from tests.rigs.test_virtual_mechanisms import laid

CONFIGURATION = Path(__file__).resolve().parents[2] / "conf"
N, STEP_S, G = 12, 0.001, 9.81
FORCES = {
    "air_drag": {"C": 7.0},
    "viscous_friction": {"c": 0.8},
    "friction_patch": {"k": 0.7, "x0": 0.9, "y0": 0.1, "w": 0.2},
    "stribeck_friction": {"k": 0.5, "vs": 0.4},
}
LOOKS = {
    "camera_latency": {"tau": 0.03},
    "camera_scale": {"k": 0.02},
    "camera_rotation": {"phi": 0.05},
    "camera_offset": {"dx": 0.01, "dy": -0.02},
    "lens_distortion": {"k": -0.1, "x0": 0.75, "y0": 0.02},
    "camera_clock": {"k": 0.03},
}
GRIPS = {
    "tool_lag": {"tau": 0.04},
    "wrist_offset": {"beta": 0.2},
    "tool_offset": {"dx": 0.01, "dy": -0.004},
}
IN_SOME_CASTS = {"cable_slip": {"s": 0.02, "v": 1.0}, "friction_drift": {"k": 0.5}}
MAKES = {
    "board_tilt": {"sx": 0.02, "sy": -0.01},
    "mass_gradient": {"k": 0.4},
    "resting_curvature": {"kappa": -1.5},
    "plastic_bending": {"softness": 0.1},
}
OTHER_LAW = {"anisotropic_friction", "endpoint_friction"}


def library(name: str) -> Effect:
    entry = OmegaConf.load(CONFIGURATION / "effects.yaml").effects[name]
    return instantiate(entry, name=name, _convert_="all")


def values(given: Mapping[str, float]) -> dict[str, np.ndarray]:
    return {name: np.array([[value]]) for name, value in given.items()}


def moving() -> CableMotion:
    """A cable of N pieces and its end somewhere on the board, every point with its own speed."""
    rng = np.random.default_rng(0)
    x, y = rng.uniform(0.6, 1.2, (1, N + 1)), rng.uniform(-0.3, 0.3, (1, N + 1))
    vx, vy = rng.normal(size=(2, 1, N + 1))
    speed = np.hypot(vx, vy)
    mass = np.append(np.full(N, CABLE.mass_kg / N), CABLE.endpoint_mass_kg)[None]
    lengths = np.full(N, CABLE.length_m / N)
    flat = np.zeros((1, N + 1))
    places = (x, y, vx, vy, vx / speed, vy / speed, flat + 1, flat)
    return CableMotion(
        *(CABLE, 0.0, STEP_S, lengths),
        *places,
        mass_kg=mass,
        friction_n=TRUTH.friction * mass * G,
        bend_rad=rng.normal(scale=0.5, size=(1, N)),
        bend_rate_rad_s=np.zeros((1, N)),
        bends_m=lengths,
        memory={},
    )


def as_pieces(cable: CableMotion, number: int = 0) -> Pieces:
    return Pieces(
        place_m=np.stack([cable.x[0], cable.y[0]], axis=1),
        velocity_m_s=np.stack([cable.vx[0], cable.vy[0]], axis=1),
        mass_kg=cable.mass_kg[0],
        radius_m=np.append(np.full(N, CABLE.radius_m), TRUTH.endpoint_radius_m),
        length_m=np.append(cable.lengths_m, 0.0),
        t_s=0.0,
        cast=number,
    )


def force_on_rig(effect: HiddenEffect, cable: CableMotion, number: int = 0) -> np.ndarray:
    """The force (n_points, 2) that an effect adds to plain friction."""
    pieces = as_pieces(cable, number)
    if acting([effect], "force"):
        return effect(pieces)
    assert acting([effect], "friction")
    slip = np.stack([cable.slip_x[0], cable.slip_y[0]], axis=1)
    return -((effect(pieces) - 1) * cable.friction_n[0])[:, None] * slip


def built(effect: HiddenEffect, truth: CableTruth = TRUTH) -> mujoco.MjSpec:
    spec = build_cable(CABLE, truth)
    effect(spec, CABLE, truth)
    return spec


def test_every_effect_that_is_compared_stands_here():
    compared = {*FORCES, *LOOKS, *GRIPS, *MAKES, *IN_SOME_CASTS}
    assert compared == {name for name, one in LIBRARY.items() if one.same_law}
    assert set(LIBRARY) - compared == OTHER_LAW


@pytest.mark.parametrize("name", FORCES)
def test_forces_on_the_cable_are_the_librarys(name):
    cable, given = moving(), FORCES[name]
    x, y = library(name).force(cable, **values(given))
    own = np.stack([np.broadcast_to(f, (1, N + 1))[0] for f in (x, y)], axis=1)
    on_rig = force_on_rig(make_effect(name, given), cable)
    points = slice(0, N) if name == "air_drag" else slice(0, N + 1)  # the rig's ball is smooth
    np.testing.assert_allclose(on_rig[points], own[points], rtol=1e-5, atol=1e-9)


def test_the_balls_own_drag_is_a_few_per_cent_of_the_cables():
    cable = moving()
    still = as_pieces(cable)
    alike = Pieces(**{**vars(still), "velocity_m_s": np.tile([1.0, 0.0], (N + 1, 1))})
    force = make_effect("air_drag", FORCES["air_drag"])(alike)[:, 0]
    assert force[-1] / force[:-1].sum() < 0.03


@pytest.mark.parametrize("name", LOOKS)
def test_the_camera_errs_as_the_librarys(name):
    given, effect = LOOKS[name], make_effect(name, LOOKS[name])
    times, places = np.arange(5) * 0.1, np.random.default_rng(1).uniform(0.3, 1.0, (5, 2))
    own = library(name)
    if own.acts_through("seen_at"):
        np.testing.assert_allclose(effect(times), own.seen_at(times[None], **values(given))[0])
    else:
        np.testing.assert_allclose(effect(places), own.seen(places[None], **values(given))[0])


@pytest.mark.parametrize("name", GRIPS)
def test_the_cable_is_held_where_the_library_holds_it(name):
    effect = make_effect(name, GRIPS[name])
    path = np.zeros((80, 5))
    path[:, :2] = np.cumsum(np.random.default_rng(2).normal(0, 1e-3, (80, 2)), axis=0)
    path[:, 3] = np.linspace(0, 0.5, 80)
    memory, held = {}, []
    for pose in path[:, [0, 1, 3]]:
        given = values(GRIPS[name])
        held.append(library(name).held_pose(pose[None], memory, STEP_S, **given)[0])
    np.testing.assert_allclose(effect(path, STEP_S)[:, [0, 1, 3]], held, atol=1e-9)


def cast(vmax_m_s: float = 1.0) -> PlannedCast:
    action = Action(0.6, 0.6, -0.6, 0.7, 0.4, vmax_m_s)
    return plan_action(action, r0_m=0.6, limits=PlanLimits())


@pytest.mark.parametrize("vmax", [0.8, 1.2])
def test_the_cable_slips_in_the_librarys_casts(vmax):
    given = IN_SOME_CASTS["cable_slip"]
    longer = make_effect("cable_slip", given)(CABLE, cast(vmax)).length_m - CABLE.length_m
    own = library("cable_slip").in_cast(np.array([[vmax]]), **values(given))
    np.testing.assert_allclose(longer, own["s"][0, 0], atol=1e-5)


@pytest.mark.parametrize("number", [0, 20, 51])
def test_friction_drifts_over_a_session_as_the_librarys(number):
    given, cable = IN_SOME_CASTS["friction_drift"], moving()
    own = library("friction_drift").in_cast(np.array([[number / 51]]), **values(given))
    x, y = library("friction_drift").force(cable, **own)
    on_rig = force_on_rig(make_effect("friction_drift", given), cable, number)
    np.testing.assert_allclose(on_rig, np.stack([x[0], y[0]], axis=1), rtol=1e-5, atol=1e-9)


def test_gravity_leans_by_the_librarys_slopes():
    given, cable = MAKES["board_tilt"], moving()
    gravity = built(make_effect("board_tilt", given)).option.gravity
    x, y = library("board_tilt").force(cable, **values(given))
    np.testing.assert_allclose(np.ravel(x / cable.mass_kg), gravity[0], rtol=1e-3)
    np.testing.assert_allclose(np.ravel(y / cable.mass_kg), gravity[1], rtol=1e-3)


def test_mass_lies_along_the_cable_as_the_library_lays_it():
    given, count = MAKES["mass_gradient"], TRUTH.segments
    spec = built(make_effect("mass_gradient", given))
    masses = np.array([spec.body(f"segment_{i}").mass for i in range(count)])
    along = (2 * np.arange(count) + 1) / count - 1
    factors = library("mass_gradient").mass_factor(along, **values(given))
    np.testing.assert_allclose(masses, CABLE.mass_kg / count * factors[0])


def test_the_cable_rests_at_the_librarys_curvature():
    given, count = MAKES["resting_curvature"], TRUTH.segments
    spec = built(make_effect("resting_curvature", given))
    rests = [spec.body(f"segment_{i}").first_joint().springref for i in range(1, count)]
    (kappa,) = np.ravel(library("resting_curvature").rest_curvature(moving(), **values(given)))
    np.testing.assert_allclose(np.array(rests) / (CABLE.length_m / count), kappa)


def test_the_cable_yields_at_the_librarys_curvature():
    given, cable = MAKES["plastic_bending"], moving()
    length = float(cable.lengths_m[0])
    bent = make_effect("plastic_bending", given)(cable.bend_rad[0], np.zeros(N), length)
    rest = bent / length
    own = library("plastic_bending").rest_curvature(cable, **values(given))
    np.testing.assert_allclose(rest[1:], own[0, 1:])  # the rig's first hinge is half as long


def test_the_end_bears_another_load_than_its_weight():
    """The cable is stiff and light, the end heavy: what bends between them carries some of it."""
    run = laid(CABLE, TRUTH)
    run.settle()
    mujoco.mj_forward(run.model, run.data)
    end, load_n = run.model.body("endpoint").id, 0.0
    for index, contact in enumerate(run.data.contact):
        if end in run.model.geom_bodyid[contact.geom]:
            force = np.zeros(6)
            mujoco.mj_contactForce(run.model, run.data, index, force)
            load_n += force[0]
    assert abs(load_n / (CABLE.endpoint_mass_kg * G) - 1) > 0.02
