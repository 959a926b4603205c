"""Training goes on after a kill, and nothing but seed and data decide what comes out."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from robotcast.policies.datasets import Dataset, Examples
from robotcast.policies.gaussian_process import GaussianProcessLearner
from robotcast.policies.network import NetworkLearner
from robotcast.policies.training import held_out_loss
from robotcast.workflow.training import Mixture, choose_mixture
from tests.policies.conftest import moved

LONG = {"outlier_m": 0.01, "passes": 13, "patience": 13}
NETWORK = NetworkLearner(
    hidden=(16, 16), batch_size=64, learning_rate=3e-3, weight_decay=1e-3, **LONG
)
SPARSE = GaussianProcessLearner(exact_up_to=50, inducing=20, learning_rate=0.1, **LONG)
LEARNERS = {"network": NETWORK, "sparse": SPARSE, "exact": replace(SPARSE, exact_up_to=500)}
ENDS_M = np.array([[0.8, 0.0], [0.9, 0.1], [1.0, -0.2], [0.7, 0.3]])


class Killed(Exception):
    """What ends a process in the middle."""


@pytest.fixture(scope="module")
def dataset(world) -> Dataset:
    return world.simulated(200, 0.2)


def killed_at(wanted: int):
    def progress(done: int, total: int, note: str = "") -> None:
        if done == wanted:
            raise Killed

    return progress


def written(folder: Path) -> dict[str, bytes]:
    return {p.name: p.read_bytes() for p in folder.iterdir()}


@pytest.mark.parametrize("name", LEARNERS)
def test_a_killed_training_ends_with_the_same_bytes_on_any_number_of_threads(
    name, dataset, tmp_path
) -> None:
    learner = LEARNERS[name]
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


def judged(misses_m: list[float], weights: tuple[float, ...] = (1, 1, 1, 1)) -> tuple[float, float]:
    """Return loss and median of a model that misses each cast by so much."""
    casts = Examples(np.zeros((4, 6)), ENDS_M, np.array(weights))
    away_m = np.array(misses_m)[:, None] * [0.6, 0.8]
    return held_out_loss(ENDS_M + away_m, casts, outlier_m=0.01)


def test_small_misses_count_as_their_square_and_the_median_is_told() -> None:
    assert judged([2e-4] * 4)[0] == pytest.approx(4 * judged([1e-4] * 4)[0], rel=1e-3)
    assert judged([0.01, 0.02, 0.03, 0.9])[1] == pytest.approx(0.025)


def test_a_whip_like_cast_does_not_outweigh_the_others_but_weights_count() -> None:
    """A pass that halves three misses is better, though it misses the fourth by twice as much."""
    assert judged([0.005, 0.005, 0.005, 0.6])[0] < judged([0.01, 0.01, 0.01, 0.3])[0]
    assert judged([0.01, 0.0, 0.0, 0.0], (4, 1, 1, 1))[0] > judged([0.01, 0.0, 0.0, 0.0])[0]


@pytest.fixture(scope="module")
def tried(world):
    """Try mixtures with a simulation that is wrong by 10 cm."""
    shifted = moved(world.simulated(150, 0.2), lambda actions: np.array([0.1, 0.0]))

    def of(weights: list[float], n_actions: int = 40) -> tuple[Mixture, ...]:
        learner = replace(SPARSE, exact_up_to=600, inducing=30, passes=3, patience=3)
        data = learner, world.real(n_actions, 0, 0.25), shifted
        return choose_mixture(*data, fractions=[0.3], weights=weights, passes=12, seed=0)

    return of


def test_where_the_simulation_is_wrong_real_casts_weigh_more(tried) -> None:
    """And all that was tried is told, the best first."""
    found = tried([0.02, 20.0])
    assert [m.real_weight for m in found] == [20.0, 0.02]
    assert found[0].held_out_miss_m < found[1].held_out_miss_m


def test_one_pair_and_two_real_actions_leave_mixtures_untried_and_none_is_refused(tried) -> None:
    assert tried([2.0]) == (Mixture(0.3, 2.0),)
    assert tried([1.0, 2.0], n_actions=2) == (Mixture(0.3, 1.0), Mixture(0.3, 2.0))
    with pytest.raises(ValueError, match="need a value each"):
        tried([])
