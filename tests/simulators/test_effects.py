"""What every effect of conf/effect/ must do inside every simulator."""

import numpy as np
import pytest
from hydra.errors import InstantiationException

from robotcast.simulators.bullet.simulator import BulletSimulator
from robotcast.simulators.chain.hybrid import HybridSimulator
from robotcast.simulators.chain.segmented import SegmentedSimulator
from robotcast.simulators.simulator import SimulatedCast
from tests.simulators.conftest import CONFIGURATION, configured, load_effect, nominal

NAMES = sorted(path.stem for path in (CONFIGURATION / "effect").glob("*.yaml"))
TUNED = {kind.name: kind.tunes for kind in (SegmentedSimulator, HybridSimulator, BulletSimulator)}
SLOW = {BulletSimulator.name: pytest.mark.slow}
OFFERED = [
    pytest.param(kind, name, marks=SLOW.get(kind, ()))
    for kind in TUNED
    for name in NAMES
    if name not in TUNED[kind]
]


def test_the_library_is_complete() -> None:
    assert len(NAMES) >= 18


@pytest.mark.parametrize(("kind", "name"), OFFERED)
def test_null_changes_no_bit_and_a_probe_moves_the_end(
    kind: str, name: str, casts: list[SimulatedCast]
) -> None:
    """Also beside other values in one batch: the first vector is null, the second is not."""
    bare, with_effect = configured(kind), configured(kind, name)
    own = with_effect.parameters[len(bare.parameters) :]
    null = nominal(with_effect)
    probe = nominal(with_effect, **{p.name: p.probes[-1] for p in own if p.null is not None})
    expected = bare.simulate(casts[:2], nominal(bare)).waypoints_m[0]
    got = with_effect.simulate(casts[:2], np.vstack([null, probe])).waypoints_m
    np.testing.assert_array_equal(got[0], expected)
    assert np.nanmax(np.abs(got[1] - expected)) > 1e-4


@pytest.mark.parametrize("kind", TUNED)
def test_all_effects_at_null_change_no_bit(kind: str, casts: list[SimulatedCast]) -> None:
    bare = configured(kind)
    loaded = configured(kind, *[name for name in NAMES if name not in TUNED[kind]])
    np.testing.assert_array_equal(
        loaded.simulate(casts[:2], nominal(loaded)).waypoints_m,
        bare.simulate(casts[:2], nominal(bare)).waypoints_m,
    )


@pytest.mark.parametrize(("kind", "name"), [(k, n) for k, names in TUNED.items() for n in names])
def test_an_effect_that_the_simulator_tunes_is_not_offered(kind: str, name: str) -> None:
    with pytest.raises(InstantiationException, match="parameter of its own"):
        configured(kind, name)


def test_an_effect_that_a_simulator_cannot_carry_is_refused() -> None:
    """One of a user's own, which acts through the hook of `bending_damping`."""
    bullet, own = configured(BulletSimulator.name), load_effect("bending_damping")
    assert isinstance(bullet, BulletSimulator)
    own.name = "hot_rubber"
    with pytest.raises(ValueError, match=r"hot_rubber acts through damping_time.*cannot carry"):
        BulletSimulator(bullet.cable, bullet.parameters, bullet.settings, [own])
