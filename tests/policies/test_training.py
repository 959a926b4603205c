"""Training goes on after a kill, and nothing but seed and data decide what comes out."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from robotcast.policies.learning.datasets import Dataset, simulated_dataset
from robotcast.policies.learning.forward_model import Learner
from robotcast.policies.learning.gaussian_process_learner import GaussianProcessLearner
from robotcast.policies.learning.network_learner import NetworkLearner

LEARNERS = {
    "network": NetworkLearner((16, 16), 64, 3e-3, 1e-3, 0.01, passes=13, patience=13),
    "sparse": GaussianProcessLearner(50, 20, 0.1, 0.01, passes=13, patience=13),
    "exact": GaussianProcessLearner(500, 20, 0.1, 0.01, passes=13, patience=13),
}


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


def test_a_killed_training_goes_on_and_ends_with_the_same_bytes(learner, dataset, tmp_path) -> None:
    unfinished = tmp_path / "state.safetensors"
    with pytest.raises(Killed):
        learner.fit(dataset, seed=0, unfinished=unfinished, progress=killed_at(8))
    seen: list[int] = []
    resumed = learner.fit(
        dataset,
        seed=0,
        unfinished=unfinished,
        progress=lambda done, total, note="": seen.append(done),
    )
    assert seen[0] == 6  # five passes stood on disk
    assert not unfinished.exists()
    resumed.save(tmp_path / "resumed")
    learner.fit(dataset, seed=0).save(tmp_path / "unbroken")
    assert written(tmp_path / "resumed") == written(tmp_path / "unbroken")


def test_the_state_of_another_training_is_not_used(learner, dataset, tmp_path) -> None:
    unfinished = tmp_path / "state.safetensors"
    with pytest.raises(Killed):
        learner.fit(dataset, seed=0, unfinished=unfinished, progress=killed_at(8))
    other = replace(dataset, training=dataset.training.weighted(2.0))
    seen: list[int] = []
    learner.fit(
        other,
        seed=0,
        unfinished=unfinished,
        progress=lambda done, total, note="": seen.append(done),
    )
    assert seen[0] == 1


def test_the_same_seed_gives_the_same_bytes_on_any_number_of_threads(
    learner, dataset, tmp_path
) -> None:
    threads = torch.get_num_threads()
    try:
        for count in (1, 2):
            torch.set_num_threads(count)
            learner.fit(dataset, seed=4).save(tmp_path / str(count))
            assert torch.get_num_threads() == count
    finally:
        torch.set_num_threads(threads)
    assert written(tmp_path / "1") == written(tmp_path / "2")
