"""Training goes on after a kill, and nothing but seed and data decide what comes out."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from robotcast.policies.datasets import Dataset, Examples, real_dataset, simulated_dataset
from robotcast.policies.gaussian_process import GaussianProcessLearner
from robotcast.policies.network import NetworkLearner
from robotcast.policies.training import Learner, held_out_loss
from robotcast.workflow.training import Mixture, choose_mixture

NETWORK = NetworkLearner(
    hidden=(16, 16),
    batch_size=64,
    learning_rate=3e-3,
    weight_decay=1e-3,
    outlier_m=0.01,
    passes=13,
    patience=13,
)
SPARSE = GaussianProcessLearner(
    exact_up_to=50, inducing=20, learning_rate=0.1, outlier_m=0.01, passes=13, patience=13
)
LEARNERS = {"network": NETWORK, "sparse": SPARSE, "exact": replace(SPARSE, exact_up_to=500)}
ENDS_M = np.array([[0.8, 0.0], [0.9, 0.1], [1.0, -0.2], [0.7, 0.3]])
SHIFT_M = np.array([0.1, 0.0])  # how far a simulation is wrong


class Killed(Exception):
    """What ends a process in the middle."""


@pytest.fixture(scope="module")
def dataset(world, tmp_path_factory) -> Dataset:
    path = world.simulated(tmp_path_factory.mktemp("simulated"), 200)
    return simulated_dataset(path, validation_fraction=0.2, seed=0)


@pytest.fixture(params=LEARNERS)
def learner(request) -> Learner:
    return LEARNERS[request.param]


def killed_at(wanted: int):
    def progress(done: int, total: int, note: str = "") -> None:
        if done == wanted:
            raise Killed

    return progress


def written(folder: Path) -> dict[str, bytes]:
    return {p.name: p.read_bytes() for p in folder.iterdir()}


def test_a_killed_training_ends_with_the_same_bytes_on_any_number_of_threads(
    learner, dataset, tmp_path
) -> None:
    unfinished, threads = tmp_path / "state.pt", torch.get_num_threads()
    seen: list[int] = []

    def note_down(done: int, total: int, note: str = "") -> None:
        seen.append(done)

    try:
        torch.set_num_threads(1)
        with pytest.raises(Killed):
            learner.fit(dataset, seed=4, unfinished=unfinished, progress=killed_at(8))
        resumed = learner.fit(dataset, seed=4, unfinished=unfinished, progress=note_down)
        assert seen[0] == 6  # five passes stood on disk
        assert not unfinished.exists()
        resumed.save(tmp_path / "resumed")
        torch.set_num_threads(2)
        learner.fit(dataset, seed=4).save(tmp_path / "unbroken")
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(threads)
    assert written(tmp_path / "resumed") == written(tmp_path / "unbroken")


def test_the_state_of_another_training_is_not_used(dataset, tmp_path) -> None:
    unfinished = tmp_path / "state.pt"
    with pytest.raises(Killed):
        NETWORK.fit(dataset, seed=0, unfinished=unfinished, progress=killed_at(6))
    other = replace(dataset, training=dataset.training.weighted(2.0))
    with pytest.raises(Killed):
        NETWORK.fit(other, seed=0, unfinished=unfinished, progress=killed_at(1))


def judged(misses_m: list[float], weights: list[float] | None = None) -> tuple[float, float]:
    """Judge a model that misses each cast by so much."""
    casts = Examples(np.zeros((4, 6)), ENDS_M, np.array(weights or [1.0] * 4))
    away_m = np.array(misses_m)[:, None] * [0.6, 0.8]
    return held_out_loss(ENDS_M + away_m, casts, outlier_m=0.01)


def loss(misses_m: list[float], weights: list[float] | None = None) -> float:
    return judged(misses_m, weights)[0]


def test_small_misses_count_as_their_square() -> None:
    assert loss([2e-4] * 4) == pytest.approx(4 * loss([1e-4] * 4), rel=1e-3)


def test_a_whip_like_cast_does_not_outweigh_the_others() -> None:
    """A pass that halves three misses is better, though it misses the fourth by twice as much."""
    assert loss([0.005, 0.005, 0.005, 0.6]) < loss([0.01, 0.01, 0.01, 0.3])


def test_weights_count_and_the_median_is_told() -> None:
    assert loss([0.01, 0.0, 0.0, 0.0], [4, 1, 1, 1]) > loss([0.01, 0.0, 0.0, 0.0])
    assert judged([0.01, 0.02, 0.03, 0.9])[1] == pytest.approx(0.025)


@pytest.fixture(scope="module")
def real(world) -> Dataset:
    return real_dataset(world.measured(40, 0), [], validation_fraction=0.25, seed=0)


def shifted(world, tmp_path_factory) -> Dataset:
    path = world.simulated(tmp_path_factory.mktemp("simulated"), 150)
    dataset = simulated_dataset(path, validation_fraction=0.2, seed=0)

    def moved(examples: Examples) -> Examples:
        return Examples(examples.actions, examples.endpoints_m + SHIFT_M, examples.weights)

    held_out = moved(dataset.validation)
    return Dataset(dataset.name, moved(dataset.training), held_out, held_out, dataset.facts)


def tried(real: Dataset, simulated: Dataset, weights: list[float]) -> tuple[Mixture, ...]:
    learner = replace(SPARSE, exact_up_to=600, inducing=30, passes=3, patience=3)
    return choose_mixture(
        learner, real, simulated, fractions=[0.3], weights=weights, passes=12, seed=0
    )


def test_where_the_simulation_is_wrong_real_casts_weigh_more(world, real, tmp_path_factory) -> None:
    """And all that was tried is told, the best first."""
    found = tried(real, shifted(world, tmp_path_factory), [0.02, 20.0])
    assert found[0].real_weight == 20.0
    misses = [m.held_out_miss_m or 0.0 for m in found]
    assert misses == sorted(misses)
    assert {m.real_weight for m in found} == {0.02, 20.0}


def test_one_pair_is_taken_without_a_trial(world, real, tmp_path_factory) -> None:
    (only,) = tried(real, shifted(world, tmp_path_factory), [2.0])
    assert only == Mixture(0.3, 2.0)


def test_two_real_actions_leave_the_mixtures_untried(world, tmp_path_factory) -> None:
    two = real_dataset(world.measured(2, 0), [], validation_fraction=0.5, seed=0)
    found = tried(two, shifted(world, tmp_path_factory), [1.0, 2.0])
    assert found == (Mixture(0.3, 1.0), Mixture(0.3, 2.0))


def test_no_value_is_refused(world, real, tmp_path_factory) -> None:
    with pytest.raises(ValueError, match="need a value each"):
        tried(real, shifted(world, tmp_path_factory), [])
