import numpy as np
import pytest

from robotcast.policies.learning.spread import Spread, held_out_scale

RANDOM = np.random.default_rng(0)
UNIT = np.array([0.5, 2.0, 1.0])


def casts(count: int, of_doubt: float, of_slope: float) -> tuple[np.ndarray, ...]:
    """Draw doubts, slopes and misses that follow them by these powers."""
    doubt = RANDOM.lognormal(0.0, 0.6, count)
    slopes = RANDOM.lognormal(0.0, 0.6, (count, 1, 1)) * RANDOM.standard_normal((2, 3))
    slope_m = np.linalg.norm(slopes * UNIT, axis=(1, 2))
    true = (doubt**of_doubt * slope_m**of_slope)[:, None] * np.array([0.010, 0.015])
    return doubt, slopes, true, true * RANDOM.standard_normal((count, 2))


@pytest.mark.parametrize(("of_doubt", "of_slope"), [(1.0, 0.0), (0.0, 1.0), (0.5, 1.0)])
def test_it_follows_whichever_the_misses_follow(of_doubt: float, of_slope: float) -> None:
    doubt, slopes, true, misses_m = casts(400, of_doubt, of_slope)
    spread = Spread.of(misses_m, doubt, slopes, UNIT, np.ones(400))
    found = spread(doubt, slopes)
    assert np.corrcoef(np.log(found[:, 0]), np.log(true[:, 0]))[0, 1] > 0.9
    np.testing.assert_allclose(np.median(found / true, axis=0), 1.0, atol=0.15)


def test_it_has_the_size_that_holds_most_casts() -> None:
    doubt, slopes, _, misses_m = casts(400, 1.0, 0.5)
    spread = Spread.of(misses_m, doubt, slopes, UNIT, np.ones(400))
    inside = np.abs(misses_m) <= spread(doubt, slopes)
    np.testing.assert_allclose(inside.mean(axis=0), 0.6827, atol=0.01)


def test_few_casts_rule_neither_out() -> None:
    doubt, slopes, _, misses_m = casts(4, 1.0, 0.0)
    spread = Spread.of(misses_m, doubt, slopes, UNIT, np.ones(4))
    assert min(spread.powers) > 0


def test_calmer_than_every_cast_is_not_believed() -> None:
    doubt, slopes, _, misses_m = casts(50, 0.5, 0.5)
    spread = Spread.of(misses_m, doubt, slopes, UNIT, np.ones(50))
    calmest = spread(np.zeros(1), np.zeros((1, 2, 3)))
    assert (calmest > 0).all()
    assert (calmest <= spread(doubt, slopes).min(axis=0)).all()


def test_a_model_that_never_misses_has_no_spread() -> None:
    doubt, slopes, _, misses_m = casts(10, 1.0, 0.5)
    spread = Spread.of(0 * misses_m, doubt, slopes, UNIT, np.ones(10))
    np.testing.assert_array_equal(spread(doubt, slopes), 0.0)


def test_an_endpoint_that_nothing_moves_is_as_unsure_as_the_model() -> None:
    doubt, slopes, _, misses_m = casts(50, 1.0, 0.0)
    spread = Spread.of(misses_m, doubt, 0 * slopes, UNIT, np.ones(50))
    found = spread(doubt, 0 * slopes)[:, 0]
    np.testing.assert_allclose(found / doubt, found[0] / doubt[0])


def test_the_plain_spread_is_the_doubt() -> None:
    doubt, slopes, _, _ = casts(5, 1.0, 1.0)
    np.testing.assert_array_equal(Spread.plain(3)(doubt, slopes), np.stack([doubt, doubt], axis=1))


def test_numbers_read_back() -> None:
    doubt, slopes, _, misses_m = casts(20, 1.0, 0.5)
    spread = Spread.of(misses_m, doubt, slopes, UNIT, np.ones(20))
    again = Spread.from_dict(spread.as_dict())
    np.testing.assert_array_equal(again(doubt, slopes), spread(doubt, slopes))


def test_a_few_casts_give_the_next_larger_quantile() -> None:
    misses_m = np.repeat(np.arange(1.0, 4.0)[:, None], 2, axis=1)
    np.testing.assert_array_equal(held_out_scale(misses_m, np.ones(3), np.ones(3)), [3.0, 3.0])
