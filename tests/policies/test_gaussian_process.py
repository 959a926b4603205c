from dataclasses import replace

import numpy as np
import pytest
import torch
from gpytorch.kernels import MaternKernel, ScaleKernel

from robotcast.policies.datasets import Dataset
from robotcast.policies.gaussian_process import GaussianProcess, GaussianProcessLearner

SMALL = GaussianProcessLearner(
    exact_up_to=100, inducing=40, learning_rate=0.1, outlier_m=0.01, passes=10, patience=10
)


@pytest.fixture(scope="module")
def real(world) -> Dataset:
    return world.real(60)


@pytest.fixture(scope="module")
def exact(real) -> GaussianProcess:
    return fitted(real)


@pytest.fixture(scope="module")
def sparse(simulated) -> GaussianProcess:
    return fitted(simulated)


def fitted(dataset: Dataset) -> GaussianProcess:
    model = SMALL.fit(dataset, seed=0)
    assert isinstance(model, GaussianProcess)
    return model


def misses_m(model: GaussianProcess, world) -> np.ndarray:
    fresh = world.actions(300, seed=9)
    return model.predict(fresh) - world.endpoints(fresh)


def test_few_casts_are_fitted_exactly_and_many_by_inducing_points(exact, sparse, real) -> None:
    assert exact.exact
    assert len(exact.points) == len(np.unique(real.training.actions, axis=0))
    assert not sparse.exact
    assert len(sparse.points) == 40


def test_both_learn_a_smooth_world(exact, sparse, world) -> None:
    for model in (exact, sparse):
        assert np.median(np.linalg.norm(misses_m(model, world), axis=1)) < 0.03


def test_the_exact_process_is_the_textbooks(exact, real) -> None:
    """Rasmussen and Williams 2006, eqs. 2.25 and 2.26."""
    training = real.training
    kernel = ScaleKernel(MaternKernel(nu=2.5, ard_num_dims=6)).double()
    kernel.outputscale = exact.variance
    kernel.base_kernel.lengthscale = exact.lengths
    seen = torch.from_numpy(exact.actions.apply(training.actions))
    asked = torch.from_numpy(exact.actions.apply(real.validation.actions))
    with torch.no_grad():
        across, own = kernel(asked, seen).to_dense(), kernel(seen).to_dense()
        noisy = own + exact.noise * torch.eye(len(seen), dtype=own.dtype)
        told = torch.from_numpy(exact.endpoints.apply(training.endpoints_m))
        mean = across @ torch.linalg.solve(noisy, told)
        left = kernel(asked, diag=True) - (across * torch.linalg.solve(noisy, across.T).T).sum(1)
    assert exact.mean(asked).numpy() == pytest.approx(mean.numpy(), abs=1e-4)
    deviation = torch.sqrt(left + exact.noise).numpy()
    assert exact.deviation(asked).numpy() == pytest.approx(deviation, rel=1e-3)


def test_an_example_of_weight_two_is_one_seen_twice(real) -> None:
    twice, held = real.training.joined(real.training), real.validation
    heavy = Dataset("heavy", real.training.weighted(2.0), held, held)
    repeated = Dataset("repeated", twice, held, held)
    actions = real.validation.actions
    one, other = (SMALL.fit(d, seed=0).predict(actions) for d in (heavy, repeated))
    assert one == pytest.approx(other, abs=1e-4)


def test_the_spread_grows_away_from_the_casts(exact, sparse, world) -> None:
    near, far = world.actions(50, seed=9), world.actions(50, seed=9)
    far[:, 0] += 3.0
    for model in (exact, sparse):
        assert (model.spread(far).mean(axis=0) > 1.5 * model.spread(near).mean(axis=0)).all()


def test_about_two_thirds_of_fresh_casts_miss_by_less_than_the_spread(sparse, world) -> None:
    within = np.abs(misses_m(sparse, world)) < sparse.spread(world.actions(300, seed=9))
    assert 0.5 < within.mean() < 0.85


def test_slopes_are_those_of_the_prediction(exact, sparse, world) -> None:
    actions, nudge = world.actions(4, seed=3), 0.0025  # errs by its square
    for model in (exact, sparse):
        slopes = model.slopes(actions)
        for column in range(6):
            step = nudge * np.eye(6)[column]
            change = model.predict(actions + step) - model.predict(actions - step)
            assert slopes[:, :, column] == pytest.approx(change / (2 * nudge), abs=2e-3)


def test_a_saved_process_predicts_the_same_after_loading(sparse, world, tmp_path) -> None:
    sparse.save(tmp_path)
    loaded = SMALL.load(tmp_path)
    actions = world.actions(50, seed=3)
    assert np.array_equal(loaded.predict(actions), sparse.predict(actions))
    assert np.array_equal(loaded.spread(actions), sparse.spread(actions))


def test_a_setting_that_cannot_train_is_refused() -> None:
    with pytest.raises(ValueError, match="policy gp: inducing must be positive"):
        replace(SMALL, inducing=0)
