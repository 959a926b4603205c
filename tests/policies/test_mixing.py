import numpy as np
import pytest

from robotcast.policies.learning.datasets import Dataset, Examples, real_dataset, simulated_dataset
from robotcast.policies.learning.gaussian_process_learner import GaussianProcessLearner
from robotcast.policies.learning.mixing import Mixture, choose_mixture

LEARNER = GaussianProcessLearner(
    exact_up_to=600, inducing=30, learning_rate=0.1, outlier_m=0.01, passes=3, patience=3
)
SHIFT_M = np.array([0.1, 0.0])  # how far the simulation is wrong


@pytest.fixture(scope="module")
def real(world) -> Dataset:
    return real_dataset(world.measured(40, 0), [], validation_fraction=0.25, seed=0)


def simulated(world, tmp_path_factory, shift_m: np.ndarray) -> Dataset:
    path = world.simulated(tmp_path_factory.mktemp("simulated"), 150)
    dataset = simulated_dataset(path, validation_fraction=0.2, seed=0)

    def moved(examples: Examples) -> Examples:
        return Examples(examples.actions, examples.endpoints_m + shift_m, examples.weights)

    held_out = moved(dataset.validation)
    return Dataset(dataset.name, moved(dataset.training), held_out, held_out, dataset.facts)


def tried(real: Dataset, simulated: Dataset, weights: list[float]) -> tuple[Mixture, ...]:
    return choose_mixture(
        LEARNER, real, simulated, fractions=[0.3], weights=weights, passes=12, seed=0
    )


def test_where_the_simulation_is_wrong_real_casts_weigh_more(world, real, tmp_path_factory) -> None:
    found = tried(real, simulated(world, tmp_path_factory, SHIFT_M), [0.02, 20.0])
    assert found[0].real_weight == 20.0


def test_all_that_was_tried_is_told_best_first(world, real, tmp_path_factory) -> None:
    found = tried(real, simulated(world, tmp_path_factory, SHIFT_M), [0.5, 1.0, 4.0])
    misses = [m.held_out_miss_m or 0.0 for m in found]
    assert misses == sorted(misses)
    assert {m.real_weight for m in found} == {0.5, 1.0, 4.0}


def test_one_pair_is_taken_without_a_trial(world, real, tmp_path_factory) -> None:
    (only,) = tried(real, simulated(world, tmp_path_factory, SHIFT_M), [2.0])
    assert only == Mixture(0.3, 2.0)


def test_two_real_actions_leave_the_mixtures_untried(world, tmp_path_factory) -> None:
    two = real_dataset(world.measured(2, 0), [], validation_fraction=0.5, seed=0)
    found = tried(two, simulated(world, tmp_path_factory, SHIFT_M), [1.0, 2.0])
    assert found == (Mixture(0.3, 1.0), Mixture(0.3, 2.0))


def test_no_value_is_refused(world, real, tmp_path_factory) -> None:
    with pytest.raises(ValueError, match="need a value each"):
        tried(real, simulated(world, tmp_path_factory, SHIFT_M), [])
