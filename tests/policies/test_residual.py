from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robotcast.policies.learning.datasets import Dataset, Examples, real_dataset, simulated_dataset
from robotcast.policies.learning.ensemble import EnsembleLearner
from robotcast.policies.learning.gaussian_process_learner import GaussianProcessLearner
from robotcast.policies.learning.residual import Residual, ResidualLearner

PROCESS = GaussianProcessLearner(
    exact_up_to=600, inducing=100, learning_rate=0.1, outlier_m=0.01, passes=30, patience=10
)
LEARNER = ResidualLearner(base=EnsembleLearner(PROCESS, 2))


def departing(examples: Examples) -> Examples:
    """Let casts depart from the simulation the more, the wider they swing."""
    away_m = np.stack([0.2 * (examples.actions[:, 0] - 0.6), 0.1 * examples.actions[:, 2]], axis=1)
    return Examples(examples.actions, examples.endpoints_m + away_m, examples.weights)


@pytest.fixture(scope="module")
def real(world) -> Dataset:
    dataset = real_dataset(world.measured(60), [], validation_fraction=0.3, seed=0)
    held_out = departing(dataset.validation)
    return Dataset("real", departing(dataset.training), held_out, held_out, dataset.facts)


@pytest.fixture(scope="module")
def simulated(world, tmp_path_factory) -> Dataset:
    path = world.simulated(tmp_path_factory.mktemp("simulated"), 500)
    return simulated_dataset(path, validation_fraction=0.2, seed=0)


def without_held_out(real: Dataset) -> Dataset:
    """The correction learns from held-out casts too: those of the tests are kept from it."""
    return replace(real, validation=real.training.take(np.arange(0)))


@pytest.fixture(scope="module")
def model(real: Dataset, simulated: Dataset) -> Residual:
    return LEARNER.fit(without_held_out(real), simulated, seed=0)


def median_miss_m(predicted_m: np.ndarray, examples: Examples) -> float:
    return float(np.median(np.linalg.norm(predicted_m - examples.endpoints_m, axis=1)))


def test_what_the_simulation_misses_smoothly_is_corrected(model: Residual, real: Dataset) -> None:
    out = real.validation
    before = median_miss_m(model.base.predict(out.actions), out)
    after = median_miss_m(model.predict(out.actions), out)
    assert after < 0.2 * before
    assert model.correction.left_out_median_m == pytest.approx(after, rel=0.5)


def test_it_is_better_than_the_measured_casts_alone(model: Residual, real: Dataset) -> None:
    alone = PROCESS.fit(real, seed=0)
    out = real.validation
    assert median_miss_m(model.predict(out.actions), out) < 0.5 * median_miss_m(
        alone.predict(out.actions), out
    )


def test_most_held_out_casts_lie_within_two_spreads(model: Residual, real: Dataset) -> None:
    out = real.validation
    away = np.abs(model.predict(out.actions) - out.endpoints_m) / model.spread(out.actions)
    assert (away < 2).mean() > 0.8


def test_wild_casts_hardly_sway_the_correction(
    model: Residual, real: Dataset, simulated: Dataset
) -> None:
    moved = real.training.endpoints_m.copy()
    moved[::10] += np.array([0.3, -0.4])
    training = Examples(real.training.actions, moved, real.training.weights)
    swayed = LEARNER.fit(without_held_out(replace(real, training=training)), simulated, seed=0)
    out = real.validation
    base = median_miss_m(model.base.predict(out.actions), out)
    assert median_miss_m(swayed.predict(out.actions), out) < 0.5 * base


def test_slopes_are_those_of_the_prediction(model: Residual, real: Dataset) -> None:
    actions = real.validation.actions[:3]
    found, step = model.slopes(actions), 1e-4
    for k in (0, 2, 3, 4):
        there, back = actions.copy(), actions.copy()
        there[:, k] += step
        back[:, k] -= step
        slope = (model.predict(there) - model.predict(back)) / (2 * step)
        np.testing.assert_allclose(found[:, :, k], slope, atol=5e-4)


def test_a_saved_model_reads_back(model: Residual, real: Dataset, tmp_path: Path) -> None:
    model.save(tmp_path)
    again = LEARNER.load(tmp_path)
    actions = real.validation.actions
    np.testing.assert_array_equal(again.predict(actions), model.predict(actions))
    np.testing.assert_array_equal(again.spread(actions), model.spread(actions))
    assert again.facts == model.facts


def test_a_folder_without_a_model_says_what_to_run(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="run the train stage first"):
        LEARNER.load(tmp_path)


def test_casts_of_two_cables_are_refused(real: Dataset, simulated: Dataset) -> None:
    other = replace(simulated, facts={"cable": "another"})
    with pytest.raises(ValueError, match="do not mix"):
        LEARNER.fit(real, other, seed=0)
