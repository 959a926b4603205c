"""What every effect of conf/effects.yaml must do inside every simulator."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hydra.errors import InstantiationException

from robotcast.simulators.bullet import BulletSettings, BulletSimulator
from robotcast.simulators.mujoco_cables import HybridSimulator, SegmentedSimulator
from robotcast.simulators.simulator import SimulatedCast
from tests.simulators.conftest import (
    CABLE,
    EFFECTS,
    STILL,
    configured,
    load_effect,
    make_casts,
    nominal,
    path,
)

NAMES = sorted(EFFECTS)
(CAST,) = make_casts(1, slowest_m_s=0.7, fastest_m_s=1.4)
CAST = replace(CAST, factors={"vmax": 2.0, "order": 1.0})
TUNED = {kind.name: kind.tunes for kind in (SegmentedSimulator, HybridSimulator, BulletSimulator)}
SLOW = {BulletSimulator.name: pytest.mark.slow}
NOT_OFFERED = {kind: {*tunes} for kind, tunes in TUNED.items()}
NOT_OFFERED[BulletSimulator.name] |= {
    name for name in NAMES if any(map(load_effect(name).acts_through, BulletSimulator.lacks))
}


@cache
def without_effects(kind: str) -> np.ndarray:
    simulator = configured(kind)
    return simulator.simulate([CAST], nominal(simulator)).waypoints_m[0]


@pytest.mark.parametrize("kind", [pytest.param(kind, marks=SLOW.get(kind, ())) for kind in TUNED])
def test_null_changes_no_bit_and_every_probe_moves_the_end(kind: str) -> None:
    """All effects beside each other in one batch: of the first vector all are null."""
    offered = [name for name in NAMES if name not in NOT_OFFERED[kind]]
    loaded = configured(kind, *offered)
    vectors = [nominal(loaded)]
    for name in offered:
        own = [p for p in loaded.parameters if p.name.startswith(f"{name}.")]
        probe = {p.name: p.probes[-1] for p in own if p.null is not None}
        vectors.append(nominal(loaded, **probe))
    null, *probed = loaded.simulate([CAST], np.vstack(vectors)).waypoints_m
    np.testing.assert_array_equal(null, without_effects(kind))
    moved_m = {n: np.nanmax(np.abs(p - null)) for n, p in zip(offered, probed, strict=True)}
    assert min(moved_m.values()) > 1e-4, moved_m


@pytest.mark.parametrize(("kind", "name"), [(k, n) for k, names in TUNED.items() for n in names])
def test_an_effect_that_the_simulator_tunes_is_not_offered(kind: str, name: str) -> None:
    with pytest.raises(InstantiationException, match="parameter of its own"):
        configured(kind, name)


def test_an_effect_that_a_simulator_cannot_carry_is_refused() -> None:
    """One of a user's own, which acts through the hook of `bending_damping`."""
    own = load_effect("bending_damping")
    own.name = "hot_rubber"
    parameters = {name: {} for name in BulletSimulator.own}
    with pytest.raises(ValueError, match=r"hot_rubber acts through damping_time.*cannot carry"):
        BulletSimulator(CABLE, parameters, BulletSettings(), [own])


def test_a_slipped_cable_reaches_as_much_farther() -> None:
    """In fast casts only, whatever the arm does; a cast whose speed nobody knows is not one."""
    simulator, values = configured("segmented", "cable_slip"), {"cable_slip.s": 0.02}
    fast, slow, unknown = (
        path(simulator, SimulatedCast(STILL, np.array([0.5]), factors=known), **values)[0, 0]
        for known in ({"vmax": 1.4}, {"vmax": 0.6}, {})
    )
    np.testing.assert_allclose(fast - unknown, 0.02, atol=1e-4)
    np.testing.assert_allclose(slow, unknown, atol=1e-6)


def test_friction_that_drifts_grows_with_the_order_of_the_cast() -> None:
    """The first cast is as without, the last as with so much more friction everywhere."""
    bare, drifting = configured("segmented"), configured("segmented", "friction_drift")
    friction = bare.parameters[0].nominal
    first, last = (replace(CAST, factors={"order": order}) for order in (0.0, 1.0))
    got = drifting.simulate([first, last], nominal(drifting, **{"friction_drift.k": 0.5}))
    for seen, own in zip(got.waypoints_m[0], (friction, 1.5 * friction), strict=True):
        alike = bare.simulate([CAST], nominal(bare, friction=own)).waypoints_m[0, 0]
        np.testing.assert_allclose(seen, alike, atol=1e-3)


def test_a_lens_that_distorts_is_undone() -> None:
    lens, rng = load_effect("lens_distortion"), np.random.default_rng(0)
    places = rng.uniform(0.3, 1.2, (1, 20, 2))
    given = {"k": np.array([[-0.1]]), "x0": np.array([[0.8]]), "y0": np.array([[0.1]])}
    np.testing.assert_allclose(lens.unseen(lens.seen(places, **given), **given), places, atol=1e-6)
