"""What every simulator must do, whatever its model of the cable."""

from dataclasses import replace

import numpy as np
import pytest
from hydra.utils import instantiate
from omegaconf import OmegaConf

from robotcast.simulators.simulator import SimulatedCast
from tests.simulators.conftest import (
    CABLE,
    CONFIGURATION,
    configured,
    displacements,
    mirrored,
    nominal,
    relative_miss,
)

KINDS = sorted(path.stem for path in (CONFIGURATION / "simulator").glob("*.yaml"))
CHAINS = [kind for kind in KINDS if kind != "bullet"]  # what steps in batches
FEW = {"bullet": 1}  # casts to ask of one that runs a few a second
MODULUS_PA = 1e6  # of a rod of `CABLE`'s radius that bends like a cord and hardly stretches
SAME_CABLE = {
    "segmented": {
        "bending_stiffness_n_m2": MODULUS_PA * 0.25 * np.pi * CABLE.radius_m**4,
        "bending_damping_s": 0.02,
        "joint_friction_n_m": 1e-7,
    },
    "hybrid": {"youngs_modulus_pa": MODULUS_PA},
}


def test_a_tilt_moves_the_same_cable_in_both_chains_alike(casts: list[SimulatedCast]) -> None:
    rod, chain = (displacements(kind, casts, SAME_CABLE[kind], 0.03) for kind in CHAINS)
    assert (relative_miss(rod, chain) < 0.1).all()


@pytest.mark.parametrize("kind", KINDS)
def test_every_parameter_moves_the_end(kind: str, casts: list[SimulatedCast]) -> None:
    simulator = configured(kind)
    middle = [p.from_unit(np.asarray(0.5)) for p in simulator.parameters]
    vectors = np.tile(middle, (len(middle) + 1, 1))
    for row, p in enumerate(simulator.parameters, start=1):
        vectors[row, row - 1] = p.from_unit(np.asarray(0.7))
    waypoints = simulator.simulate(casts[: FEW.get(kind)], vectors).waypoints_m
    moved = np.nanmax(np.abs(waypoints[1:] - waypoints[0]), axis=(1, 2, 3))
    assert (moved > 1e-4).all(), moved


def test_a_cable_without_a_weight_at_its_end_moves_in_all(casts: list[SimulatedCast]) -> None:
    """Its weight is not searched, and no body of mass zero stands still."""
    for kind in KINDS:
        model = OmegaConf.load(CONFIGURATION / "simulator" / f"{kind}.yaml").model
        bare = replace(CABLE, endpoint_mass_kg=0.0)
        simulator = instantiate(model, cable=bare, effects=[])
        (weight,) = (p for p in simulator.parameters if p.name == "endpoint_mass_kg")
        assert weight.frozen
        found = simulator.simulate(casts[:1], nominal(simulator)).waypoints_m[0, 0]
        path = found[np.isfinite(found[:, 0])]
        assert np.linalg.norm(path[-1] - path[0]) > 0.2 * CABLE.length_m


@pytest.mark.parametrize("kind", CHAINS)
def test_a_mirrored_cast_mirrors(kind: str, casts: list[SimulatedCast]) -> None:
    simulator = configured(kind)
    here = simulator.simulate(casts, nominal(simulator)).waypoints_m
    there = simulator.simulate([mirrored(c) for c in casts], nominal(simulator)).waypoints_m
    np.testing.assert_allclose(there, here * [1.0, -1.0], atol=1e-4)


@pytest.mark.parametrize("kind", CHAINS)
def test_processes_and_batches_change_no_bit(kind: str, casts: list[SimulatedCast]) -> None:
    one = configured(kind, processes=1)
    vectors = np.repeat(nominal(one), 3, axis=0) * np.array([[0.9], [1.0], [1.1]])
    expected = one.simulate(casts, vectors).waypoints_m
    for settings in ({"processes": 2}, {"processes": 1, "batch_size": 5}):
        got = configured(kind, **settings).simulate(casts, vectors).waypoints_m
        np.testing.assert_array_equal(got, expected)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_vectors_all_over_the_bounds_all_end(kind: str, casts: list[SimulatedCast]) -> None:
    """None hangs or crashes; a cast that diverges is marked, and no other is NaN."""
    simulator = configured(kind)
    n = 10 if kind in FEW else 100
    unit = np.random.default_rng(0).uniform(size=(n, len(simulator.parameters)))
    vectors = np.column_stack(
        [p.from_unit(u) for p, u in zip(simulator.parameters, unit.T, strict=True)]
    )
    prediction = simulator.simulate(casts[: FEW.get(kind, 3)], vectors)
    np.testing.assert_array_equal(
        np.isnan(prediction.waypoints_m[:, :, 0]).all(axis=-1), prediction.diverged
    )
