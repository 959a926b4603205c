from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robotcast.policies.datasets import Dataset, Examples
from robotcast.policies.gaussian_process import GaussianProcessLearner
from robotcast.policies.residual import Residual, ResidualLearner, corrected
from tests.policies.conftest import moved

PROCESS = GaussianProcessLearner(
    exact_up_to=600, inducing=60, learning_rate=0.1, outlier_m=0.01, passes=25, patience=10
)
LEARNER = ResidualLearner(member=PROCESS, members=2)
BENDS_M = 0.3


def wider(actions: np.ndarray) -> np.ndarray:
    """Return departures from the simulation, the larger, the wider casts swing."""
    return np.stack([0.2 * (actions[:, 0] - 0.6), 0.1 * actions[:, 2]], axis=1)


@pytest.fixture(scope="module")
def real(world) -> Dataset:
    return moved(world.real(60, held_out=0.3), wider)


@pytest.fixture(scope="module")
def model(world, real: Dataset) -> Residual:
    # the correction learns from held-out casts too: those of the tests are kept from it
    kept = replace(real, validation=real.training.take(np.arange(0)))
    return LEARNER.fit(kept, world.simulated(250, 0.2), seed=0)


def median_miss_m(predicted_m: np.ndarray, examples: Examples) -> float:
    return float(np.median(np.linalg.norm(predicted_m - examples.endpoints_m, axis=1)))


def of_base(model: Residual, actions: np.ndarray) -> np.ndarray:
    return np.mean([member.predict(actions) for member in model.base], axis=0)


def test_what_the_simulation_misses_smoothly_is_corrected(model: Residual, real: Dataset) -> None:
    out = real.validation
    before = median_miss_m(of_base(model, out.actions), out)
    after = median_miss_m(model.predict(out.actions), out)
    assert after < 0.2 * before
    assert model.left_out_median_m == pytest.approx(after, rel=0.5)


def test_it_is_better_than_the_measured_casts_alone(model: Residual, real: Dataset) -> None:
    out = real.validation
    alone_m = median_miss_m(PROCESS.fit(real, seed=0).predict(out.actions), out)
    assert median_miss_m(model.predict(out.actions), out) < 0.5 * alone_m


def test_most_held_out_casts_lie_within_two_spreads(model: Residual, real: Dataset) -> None:
    out = real.validation
    away = np.abs(model.predict(out.actions) - out.endpoints_m) / model.spread(out.actions)
    assert (away < 2).mean() > 0.8


def test_wild_casts_hardly_sway_the_correction(model: Residual, real: Dataset) -> None:
    ends_m = real.training.endpoints_m.copy()
    ends_m[::10] += np.array([0.3, -0.4])
    swayed = corrected(model.base, replace(real.training, endpoints_m=ends_m), {}, seed=0)
    out = real.validation
    base = median_miss_m(of_base(model, out.actions), out)
    assert median_miss_m(swayed.predict(out.actions), out) < 0.5 * base


def test_slopes_are_those_of_the_prediction(model: Residual, real: Dataset) -> None:
    actions = real.validation.actions[:3]
    found, step = model.slopes(actions), 1e-4
    for k in (0, 2, 3, 4):
        nudge = step * np.eye(6)[k]
        slope = (model.predict(actions + nudge) - model.predict(actions - nudge)) / (2 * step)
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


class Swinging:
    """A forward model whose casts scatter the more, the farther the second turn goes."""

    def predict(self, actions: np.ndarray) -> np.ndarray:
        return np.stack([np.sin(actions[:, 0]), np.cos(actions[:, 0])], axis=1)

    def slopes(self, actions: np.ndarray) -> np.ndarray:
        found = np.zeros((len(actions), 2, 6))
        found[:, 0, 0], found[:, 1, 0] = np.cos(actions[:, 0]), -np.sin(actions[:, 0])
        return found

    def spread(self, actions: np.ndarray, slopes: np.ndarray | None = None) -> np.ndarray:
        return np.repeat(0.002 * np.exp(2 * actions[:, [2]]), 2, axis=1)


SWINGING: Any = Swinging()


def cast(count: int, seed: int) -> tuple[Examples, np.ndarray]:
    """Draw casts that depart smoothly and scatter as the model says; and where none scatters."""
    random = np.random.default_rng(seed)
    actions = random.uniform(-1, 1, (count, 6))
    away_m = BENDS_M * np.stack([actions[:, 1] ** 2, actions[:, 0] * actions[:, 3]], axis=1)
    calm_m = SWINGING.predict(actions) + away_m
    noisy_m = calm_m + SWINGING.spread(actions) * random.standard_normal((count, 2))
    return Examples(actions, noisy_m, np.ones(count)), calm_m


def correct(casts: Examples) -> Residual:
    return corrected((SWINGING,), casts, {}, seed=0)


@pytest.fixture(scope="module")
def learned() -> Residual:
    return correct(cast(250, 0)[0])


def test_smooth_departures_and_the_scatter_that_the_model_knows_are_learned(learned) -> None:
    casts, calm_m = cast(300, 1)
    miss_m = np.linalg.norm(learned.predict(casts.actions) - calm_m, axis=1)
    assert np.median(miss_m) < 0.1 * BENDS_M * np.sqrt(2 / 9)
    found = learned.spread(casts.actions)[:, 0]
    true = SWINGING.spread(casts.actions)[:, 0]
    loud = true > 0.006
    assert np.corrcoef(np.log(found[loud]), np.log(true[loud]))[0, 1] > 0.9
    assert np.median(found[loud] / true[loud]) == pytest.approx(1.0, abs=0.3)


def test_repeats_of_an_action_say_nothing_of_how_sure_it_is() -> None:
    casts, _ = cast(60, 2)
    twice = casts.joined(casts)  # without noise of their own
    once = correct(casts)
    assert correct(twice).left_out_median_m > 0.5 * once.left_out_median_m
    again = correct(casts)  # and the same casts give the same numbers
    assert again.of_spread == once.of_spread
    np.testing.assert_array_equal(again.process.known.numpy(), once.process.known.numpy())


def test_what_is_left_out_is_as_far_as_new_casts_are(learned: Residual) -> None:
    casts, _ = cast(400, 5)
    away_m = casts.endpoints_m - learned.predict(casts.actions)
    new_m = float(np.median(np.linalg.norm(away_m, axis=1)))
    assert learned.left_out_median_m == pytest.approx(new_m, rel=0.25)


def test_two_casts_are_enough_not_to_fail() -> None:
    learned = correct(cast(2, 3)[0])
    assert np.isfinite(learned.predict(cast(5, 4)[0].actions)).all()
