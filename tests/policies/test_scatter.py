import numpy as np
import pytest
import torch

from robotcast.policies.learning.scatter import fit_scatter


def ones(count: int) -> torch.Tensor:
    return torch.ones(count, dtype=torch.float64)


def examples(count: int, seed: int = 0) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Return features (n, 40), their true scatter (n,) and misses that scatter so."""
    random = np.random.default_rng(seed)
    features = random.normal(size=(count, 3)) @ random.normal(size=(3, 40))
    scatter = np.exp(0.8 * features[:, 0] / features[:, 0].std())
    misses = scatter * random.laplace(size=count)
    return (
        torch.from_numpy(features),
        torch.from_numpy(scatter),
        torch.from_numpy(np.abs(misses)),
    )


def test_it_finds_where_casts_scatter() -> None:
    features, true, misses = examples(4000)
    scatter = fit_scatter(features, misses, ones(4000))
    found = scatter(features)
    ratio = (found / true).log()
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
