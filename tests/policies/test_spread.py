import numpy as np
import pytest
import torch

from robotcast.policies.forward_model import Spread, held_out_scale
from robotcast.policies.network import fit_scatter

UNIT = np.array([0.5, 2.0, 1.0])


class Casts:
    """Casts whose misses follow doubts and slopes by these powers, and the spread set on them."""

    def __init__(
        self, count: int, of_doubt: float, of_slope: float, missed=1.0, sloping=1.0, seed=0
    ):
        random = np.random.default_rng(seed)
        self.doubt = random.lognormal(0.0, 0.6, count)
        slopes = random.lognormal(0.0, 0.6, (count, 1, 1)) * random.standard_normal((2, 3))
        slope_m = np.linalg.norm(slopes * UNIT, axis=(1, 2))
        self.true = (self.doubt**of_doubt * slope_m**of_slope)[:, None] * np.array([0.010, 0.015])
        self.misses_m = missed * self.true * random.standard_normal((count, 2))
        slopes = sloping * slopes
        self.spread = Spread.of(self.misses_m, self.doubt, slopes, UNIT, np.ones(count))
        self.found = self.spread(self.doubt, slopes)


@pytest.mark.parametrize(("of_doubt", "of_slope"), [(1.0, 0.0), (0.0, 1.0), (0.5, 1.0)])
def test_it_follows_whichever_the_misses_follow(of_doubt: float, of_slope: float) -> None:
    casts = Casts(400, of_doubt, of_slope)
    assert np.corrcoef(np.log(casts.found[:, 0]), np.log(casts.true[:, 0]))[0, 1] > 0.9
    np.testing.assert_allclose(np.median(casts.found / casts.true, axis=0), 1.0, atol=0.15)


def test_it_has_the_size_that_holds_most_casts() -> None:
    casts = Casts(400, 1.0, 0.5)
    inside = np.abs(casts.misses_m) <= casts.found
    np.testing.assert_allclose(inside.mean(axis=0), 0.6827, atol=0.01)


def test_few_casts_rule_neither_out() -> None:
    assert Casts(4, 1.0, 0.0).spread.powers.min() > 0


def test_calmer_than_every_cast_is_not_believed() -> None:
    casts = Casts(50, 0.5, 0.5)
    calmest = casts.spread(np.zeros(1), np.zeros((1, 2, 3)))
    assert (calmest > 0).all()
    assert (calmest <= casts.found.min(axis=0)).all()


def test_a_model_that_never_misses_has_no_spread() -> None:
    np.testing.assert_array_equal(Casts(10, 1.0, 0.5, missed=0.0).found, 0.0)


def test_an_endpoint_that_nothing_moves_is_as_unsure_as_the_model() -> None:
    casts = Casts(50, 1.0, 0.0, sloping=0.0)
    relative = casts.found[:, 0] / casts.doubt ** casts.spread.powers[0]
    np.testing.assert_allclose(relative, relative[0])


def test_a_few_casts_give_the_next_larger_quantile() -> None:
    misses_m = np.repeat(np.arange(1.0, 4.0)[:, None], 2, axis=1)
    np.testing.assert_array_equal(held_out_scale(misses_m, np.ones(3), np.ones(3)), [3.0, 3.0])


def ones(count: int) -> torch.Tensor:
    return torch.ones(count, dtype=torch.float64)


def examples(count: int, seed: int = 0) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Return features (n, 40), their true scatter (n,) and misses that scatter so."""
    random = np.random.default_rng(seed)
    features = random.normal(size=(count, 3)) @ random.normal(size=(3, 40))
    scatter = np.exp(0.8 * features[:, 0] / features[:, 0].std())
    misses = np.abs(scatter * random.laplace(size=count))
    features, scatter, misses = map(torch.from_numpy, (features, scatter, misses))
    return features, scatter, misses


def test_it_finds_where_casts_scatter() -> None:
    features, true, misses = examples(4000)
    ratio = (fit_scatter(features, misses, ones(4000))(features) / true).log()
    assert ratio.std() < 0.1
    assert true.log().std() > 0.7


def test_heavy_examples_count_like_many() -> None:
    features, _, misses = examples(1000)
    twice = torch.cat([features, features[:500]]), torch.cat([misses, misses[:500]])
    weights = torch.cat([2 * ones(500), ones(500)])
    heavy = fit_scatter(features, misses, weights)(features)
    repeated = fit_scatter(*twice, ones(1500))(features)
    assert heavy.numpy() == pytest.approx(repeated.numpy(), rel=0.05)


def test_few_casts_show_one_scatter_for_all() -> None:
    features, _, misses = examples(40)
    found = fit_scatter(features, misses, ones(40))(features)
    assert found.std() == pytest.approx(0.0, abs=1e-9)


def test_nothing_is_believed_beyond_the_examples() -> None:
    features, _, misses = examples(1000)
    scatter = fit_scatter(features, misses, ones(1000))
    seen, far = scatter(features), scatter(100 * features)
    assert far.max() <= seen.max() * (1 + 1e-9)
    assert far.min() >= seen.min() * (1 - 1e-9)


def test_wild_casts_do_not_sway_it() -> None:
    features, true, misses = examples(2000)
    misses[::100] *= 1000
    ratio = (fit_scatter(features, misses, ones(2000))(features) / true).log()
    assert ratio.std() < 0.3
