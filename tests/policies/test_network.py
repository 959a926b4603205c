from dataclasses import replace

import numpy as np
import pytest

from robotcast.policies.datasets import Dataset, Examples
from robotcast.policies.forward_model import LearnedModel, best_epoch
from robotcast.policies.network import NetworkLearner

STEPS = {"batch_size": 64, "learning_rate": 3e-3, "weight_decay": 0.0, "outlier_m": 0.01}
SMALL = NetworkLearner(hidden=(32, 32), passes=40, patience=40, **STEPS)


@pytest.fixture(scope="module")
def network(simulated) -> LearnedModel:
    return SMALL.fit(simulated, seed=0)


def test_it_learns_a_smooth_world(network, world) -> None:
    fresh = world.actions(500, seed=9)
    ends = world.endpoints(fresh)
    misses = np.linalg.norm(network.predict(fresh) - ends, axis=1)
    assert np.median(misses) < 0.1 * np.linalg.norm(ends.std(axis=0))


def test_inputs_and_outputs_are_normalised_on_the_training_part(network, simulated) -> None:
    inputs = network.actions.apply(simulated.training.actions)
    assert inputs.mean(axis=0) == pytest.approx(np.zeros(6), abs=1e-9)
    assert inputs.std(axis=0) == pytest.approx(np.ones(6))
    outputs = network.endpoints.apply(simulated.training.endpoints_m)
    assert outputs.std(axis=0) == pytest.approx(np.ones(2))


def test_a_saved_network_predicts_the_same_after_loading(network, world, tmp_path) -> None:
    network.save(tmp_path)
    loaded = SMALL.load(tmp_path)
    actions = world.actions(50, seed=3)
    assert np.array_equal(loaded.predict(actions), network.predict(actions))
    written = {p.name for p in tmp_path.iterdir()}
    assert written == {"weights.safetensors", "policy.yaml", "training.csv"}


def test_another_seed_gives_another_network(network, simulated, world) -> None:
    other = SMALL.fit(simulated, seed=1)
    actions = world.actions(5)
    assert not np.allclose(other.predict(actions), network.predict(actions))


def test_weights_that_do_not_belong_to_the_description_are_refused(network, tmp_path) -> None:
    network.save(tmp_path)
    weights = tmp_path / "weights.safetensors"
    weights.write_bytes(weights.read_bytes()[:-1] + b"\x01")
    with pytest.raises(ValueError, match="train again"):
        SMALL.load(tmp_path)


def test_training_stops_early_and_keeps_the_best_epoch(world) -> None:
    learner = replace(SMALL, hidden=(32,), learning_rate=0.05, passes=400, patience=5)
    network = learner.fit(world.real(12, 0, 0.3), seed=0)
    losses = [e.validation_loss for e in network.history]
    assert len(losses) < 400
    assert best_epoch(network.history).epoch == 1 + int(np.argmin(losses))
    assert len(losses) == best_epoch(network.history).epoch + 5


def test_a_heavier_example_is_fitted_better(world) -> None:
    actions = np.repeat(world.actions(1), 2, axis=0)
    ends = np.array([[0.8, -0.3], [0.804, -0.3]])
    contradiction = Examples(actions, ends, np.array([3.0, 1.0]))
    dataset = Dataset("contradiction", contradiction, contradiction, contradiction)
    learner = replace(SMALL, hidden=(16,), learning_rate=0.02, passes=300, patience=300)
    network = learner.fit(dataset, seed=0)
    assert network.predict(actions)[0] == pytest.approx([0.801, -0.3], abs=3e-4)


def test_progress_is_reported_every_epoch(simulated) -> None:
    seen = []
    learner = replace(SMALL, hidden=(8,), passes=3)
    learner.fit(simulated, seed=0, progress=lambda done, total, note="": seen.append((done, total)))
    assert seen == [(1, 3), (2, 3), (3, 3)]


def test_a_setting_that_cannot_train_is_refused() -> None:
    with pytest.raises(ValueError, match="batch_size must be positive"):
        replace(SMALL, batch_size=0)
