import numpy as np
import pytest
import torch

from robotcast.policies.learning.datasets import Dataset, real_dataset, simulated_dataset
from robotcast.policies.learning.network import Network
from robotcast.policies.learning.network_learner import NetworkLearner
from robotcast.policies.learning.training import best_epoch

SMALL = NetworkLearner(
    hidden=(32, 32),
    batch_size=64,
    learning_rate=3e-3,
    weight_decay=0.0,
    outlier_m=0.01,
    passes=40,
    patience=40,
)


@pytest.fixture(scope="module")
def dataset(world, tmp_path_factory) -> Dataset:
    path = world.simulated(tmp_path_factory.mktemp("simulated"))
    return simulated_dataset(path, validation_fraction=0.1, seed=0)


@pytest.fixture(scope="module")
def network(dataset) -> Network:
    return SMALL.fit(dataset, seed=0)


def median_error_m(network: Network, world) -> float:
    fresh = world.actions(500, seed=9)
    away = network.predict(fresh) - world.endpoints(fresh)
    return float(np.median(np.linalg.norm(away, axis=1)))


def test_it_learns_a_smooth_world(network, world) -> None:
    spread = np.linalg.norm(world.endpoints(world.actions(500)).std(axis=0))
    assert median_error_m(network, world) < 0.1 * spread


def test_predictions_have_one_endpoint_an_action(network, world) -> None:
    assert network.predict(world.actions(7)).shape == (7, 2)


def test_inputs_and_outputs_are_normalised_on_the_training_part(network, dataset) -> None:
    inputs = network.actions.apply(dataset.training.actions)
    assert inputs.mean(axis=0) == pytest.approx(np.zeros(6), abs=1e-9)
    assert inputs.std(axis=0) == pytest.approx(np.ones(6))
    outputs = network.endpoints.apply(dataset.training.endpoints_m)
    assert outputs.std(axis=0) == pytest.approx(np.ones(2))


def test_a_saved_network_predicts_the_same_after_loading(network, world, tmp_path) -> None:
    network.save(tmp_path)
    loaded = SMALL.load(tmp_path)
    actions = world.actions(50, seed=3)
    assert np.array_equal(loaded.predict(actions), network.predict(actions))
    assert {p.name for p in tmp_path.iterdir()} == {
        "weights.safetensors",
        "policy.yaml",
        "training.csv",
    }


def test_the_same_seed_gives_the_same_bytes_on_any_number_of_threads(dataset, tmp_path) -> None:
    threads = torch.get_num_threads()
    try:
        for count in (1, 2):
            torch.set_num_threads(count)
            SMALL.fit(dataset, seed=4).save(tmp_path / str(count))
            assert torch.get_num_threads() == count
    finally:
        torch.set_num_threads(threads)
    for name in ("weights.safetensors", "policy.yaml", "training.csv"):
        assert (tmp_path / "1" / name).read_bytes() == (tmp_path / "2" / name).read_bytes()


def test_another_seed_gives_another_network(network, dataset, world) -> None:
    other = SMALL.fit(dataset, seed=1)
    actions = world.actions(5)
    assert not np.allclose(other.predict(actions), network.predict(actions))


def test_weights_that_do_not_belong_to_the_description_are_refused(network, tmp_path) -> None:
    network.save(tmp_path)
    weights = tmp_path / "weights.safetensors"
    weights.write_bytes(weights.read_bytes()[:-1] + b"\x01")
    with pytest.raises(ValueError, match="train again"):
        SMALL.load(tmp_path)


def test_training_stops_early_and_keeps_the_best_epoch(world) -> None:
    few = real_dataset(world.measured(12, 0), [], validation_fraction=0.3, seed=0)
    learner = NetworkLearner((32,), 64, 0.05, 0.0, 0.01, passes=400, patience=5)
    network = learner.fit(few, seed=0)
    losses = [e.validation_loss for e in network.history]
    assert len(losses) < 400
    assert best_epoch(network.history).epoch == 1 + int(np.argmin(losses))
    assert len(losses) == best_epoch(network.history).epoch + 5


def test_a_heavier_example_is_fitted_better(world) -> None:
    actions = np.repeat(world.actions(1), 2, axis=0)
    ends = np.array([[0.8, -0.3], [0.804, -0.3]])
    few = real_dataset(world.measured(12, 0), [], validation_fraction=0.3, seed=0)
    contradiction = type(few.training)(actions, ends, np.array([3.0, 1.0]))
    dataset = Dataset("contradiction", contradiction, contradiction, contradiction)
    network = NetworkLearner((16,), 64, 0.02, 0.0, 0.01, passes=300, patience=300).fit(
        dataset, seed=0
    )
    assert network.predict(actions)[0] == pytest.approx([0.801, -0.3], abs=3e-4)


def test_progress_is_reported_every_epoch(dataset) -> None:
    seen = []
    learner = NetworkLearner((8,), 256, 1e-3, 0.0, 0.01, passes=3, patience=9)
    learner.fit(dataset, seed=0, progress=lambda done, total, note="": seen.append((done, total)))
    assert seen == [(1, 3), (2, 3), (3, 3)]


def test_a_setting_that_cannot_train_is_refused() -> None:
    with pytest.raises(ValueError, match="batch_size must be positive"):
        NetworkLearner((8,), 0, 1e-3, 0.0, 0.01, passes=3, patience=9)
