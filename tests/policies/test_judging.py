import numpy as np
import pytest

from robotcast.policies.learning.datasets import Examples
from robotcast.policies.learning.judging import Held
from robotcast.policies.learning.normalisation import Normalisation

ENDS_M = np.array([[0.8, 0.0], [0.9, 0.1], [1.0, -0.2], [0.7, 0.3]])
PLAIN = Normalisation(np.zeros(6), np.ones(6)), Normalisation(np.zeros(2), np.ones(2))


def loss(misses_m: list[float], weights: list[float] | None = None) -> float:
    """Judge a model that misses each cast by so much."""
    casts = Examples(np.zeros((4, 6)), ENDS_M, np.array(weights or [1.0] * 4))
    away_m = np.array(misses_m)[:, None] * [0.6, 0.8]
    return Held(casts, *PLAIN, outlier_m=0.01).judge(lambda _: ENDS_M + away_m)[0]


def test_small_misses_count_as_their_square() -> None:
    assert loss([2e-4] * 4) == pytest.approx(4 * loss([1e-4] * 4), rel=1e-3)


def test_a_whip_like_cast_does_not_outweigh_the_others() -> None:
    """A pass that halves three misses is better, though it misses the fourth by twice as much."""
    assert loss([0.005, 0.005, 0.005, 0.6]) < loss([0.01, 0.01, 0.01, 0.3])


def test_weights_count_and_the_median_is_told() -> None:
    assert loss([0.01, 0.0, 0.0, 0.0], [4, 1, 1, 1]) > loss([0.01, 0.0, 0.0, 0.0])
    casts = Examples(np.zeros((4, 6)), ENDS_M, np.ones(4))
    away_m = np.array([[0.01, 0.0], [0.02, 0.0], [0.03, 0.0], [0.9, 0.0]])
    median_m = Held(casts, *PLAIN, outlier_m=0.01).judge(lambda _: ENDS_M + away_m)[1]
    assert median_m == pytest.approx(0.025)
