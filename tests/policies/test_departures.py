from pathlib import Path

import numpy as np
import pytest

from robotcast.policies.learning.datasets import Examples
from robotcast.policies.learning.departures import Departures, learn_departures, seen_by

BENDS_M = 0.3


class Swinging:
    """A forward model whose casts scatter the more, the farther the second turn goes."""

    def __init__(self) -> None:
        self.facts: dict[str, object] = {}
        self.history = ()

    def predict(self, actions: np.ndarray) -> np.ndarray:
        return np.stack([np.sin(actions[:, 0]), np.cos(actions[:, 0])], axis=1)

    def slopes(self, actions: np.ndarray) -> np.ndarray:
        found = np.zeros((len(actions), 2, 6))
        found[:, 0, 0], found[:, 1, 0] = np.cos(actions[:, 0]), -np.sin(actions[:, 0])
        return found

    def spread(self, actions: np.ndarray) -> np.ndarray:
        return np.repeat(0.002 * np.exp(2 * actions[:, [2]]), 2, axis=1)

    def save(self, folder: Path) -> None:
        raise NotImplementedError


BASE = Swinging()


def cast(count: int, seed: int) -> tuple[Examples, np.ndarray]:
    """Draw casts that depart smoothly and scatter as the model says; and where none scatters."""
    random = np.random.default_rng(seed)
    actions = random.uniform(-1, 1, (count, 6))
    away_m = BENDS_M * np.stack([actions[:, 1] ** 2, actions[:, 0] * actions[:, 3]], axis=1)
    calm_m = BASE.predict(actions) + away_m
    noisy_m = calm_m + BASE.spread(actions) * random.standard_normal((count, 2))
    return Examples(actions, noisy_m, np.ones(count)), calm_m


@pytest.fixture(scope="module")
def learned() -> Departures:
    return learn_departures(BASE, cast(250, 0)[0], seed=0)


def test_smooth_departures_are_learned(learned: Departures) -> None:
    casts, calm_m = cast(300, 1)
    seen = seen_by(BASE, casts.actions)
    miss_m = np.linalg.norm(seen[:, 6:8] + learned.process.predict(seen) - calm_m, axis=1)
    assert np.median(miss_m) < 0.1 * BENDS_M * np.sqrt(2 / 9)


def test_the_noise_follows_the_scatter_that_the_model_knows(learned: Departures) -> None:
    casts, _ = cast(300, 1)
    found = learned.noise(BASE, casts.actions) * learned.scale.mean()
    true = BASE.spread(casts.actions)[:, 0]
    assert np.corrcoef(np.log(found), np.log(true))[0, 1] > 0.9
    loud = true > 0.006
    assert np.median(found[loud] / true[loud]) == pytest.approx(1.0, abs=0.3)


def test_repeats_of_an_action_say_nothing_of_how_sure_it_is() -> None:
    casts, _ = cast(60, 2)
    twice = casts.joined(casts)  # without noise of their own
    once_m = learn_departures(BASE, casts, seed=0).left_out_median_m
    assert learn_departures(BASE, twice, seed=0).left_out_median_m > 0.5 * once_m


def test_what_is_left_out_is_as_far_as_new_casts_are(learned: Departures) -> None:
    casts, _ = cast(400, 5)
    seen = seen_by(BASE, casts.actions)
    away_m = casts.endpoints_m - seen[:, 6:8] - learned.process.predict(seen)
    new_m = float(np.median(np.linalg.norm(away_m, axis=1)))
    assert learned.left_out_median_m == pytest.approx(new_m, rel=0.25)


def test_the_same_casts_give_the_same_numbers(learned: Departures) -> None:
    again = learn_departures(BASE, cast(250, 0)[0], seed=0)
    assert again.noise.of_spread == learned.noise.of_spread
    np.testing.assert_array_equal(
        again.process.posterior.known.numpy(), learned.process.posterior.known.numpy()
    )


def test_two_casts_are_enough_not_to_fail() -> None:
    learned = learn_departures(BASE, cast(2, 3)[0], seed=0)
    assert np.isfinite(learned.process.predict(seen_by(BASE, cast(5, 4)[0].actions))).all()
