"""Fits against problems whose answer is known."""

import numpy as np
import pytest

from robotcast.fitting.least_squares import LOST, Fit, Prior, Stepping, fit_robustly

TIMES_S = np.linspace(0.0, 2.0, 21)
STARTS_M = np.linspace(0.5, 2.0, 12)
TRUE = np.array([0.3, 0.7])  # of the ranges of rate and gain
NOISE_M = 0.01
EVERYTHING = np.arange(len(STARTS_M))


def decays(vectors: np.ndarray) -> np.ndarray:
    """Decays gain · x0 · exp(−rate t), (n_vectors, n_trials, k)."""
    rate, gain = 4.0 * vectors[:, :1], 0.5 + vectors[:, 1:2]
    return gain[..., None] * STARTS_M[:, None] * np.exp(-rate[..., None] * TIMES_S)


def residuals(measured: np.ndarray):
    def evaluate(vectors: np.ndarray, trials: np.ndarray) -> np.ndarray:
        difference = (decays(vectors) - measured)[:, trials]
        return difference / (NOISE_M * np.sqrt(len(TIMES_S)))

    return evaluate


@pytest.fixture
def measured() -> np.ndarray:
    noise = np.random.default_rng(3).normal(0, NOISE_M, (len(STARTS_M), len(TIMES_S)))
    return decays(TRUE[None])[0] + noise


def fit(evaluate, start=(0.8, 0.2), iterations=12, **more) -> Fit:
    return fit_robustly(
        evaluate, np.array(start), np.full(2, 0.02), EVERYTHING, iterations=iterations, **more
    )


def test_a_fit_finds_the_parameters_within_the_noise(measured: np.ndarray) -> None:
    found = fit(residuals(measured))
    np.testing.assert_allclose(found.vector, TRUE, atol=0.005)


def test_one_trial_far_off_does_not_decide(measured: np.ndarray) -> None:
    astray = measured.copy()
    astray[-1] += 3.0
    found = fit(residuals(astray))
    np.testing.assert_allclose(found.vector, TRUE, atol=0.01)
    assert found.weights[-1] < 1e-3 * np.median(found.weights)


def test_a_trial_that_diverges_beside_the_point_hardly_has_a_slope(measured: np.ndarray) -> None:
    smooth = residuals(measured)

    def cliff(vectors: np.ndarray, trials: np.ndarray) -> np.ndarray:
        values = smooth(vectors, trials)
        values[vectors[:, 0] > 0.81, 4] = 1e4
        return values

    found = fit(cliff)
    np.testing.assert_allclose(found.vector, TRUE, atol=0.005)
    first = fit(cliff, iterations=1)
    assert np.abs(first.jacobian[4]).max() < 1e-2 * 1e4 / 0.02


@pytest.mark.parametrize("central", [True, False])
def test_a_run_that_is_lost_at_one_difference_keeps_the_slopes_of_the_others(
    measured: np.ndarray, central: bool
) -> None:
    smooth = residuals(measured)

    def broken(vectors: np.ndarray, trials: np.ndarray) -> np.ndarray:
        values = smooth(vectors, trials)
        values[vectors[:, 1] > 0.21, 4] = np.eye(1, len(TIMES_S)) * LOST
        return values

    looked = {"iterations": 0, "stepping": Stepping(central=central)}
    whole, found = fit(smooth, **looked).jacobian, fit(broken, **looked).jacobian
    whole[4, :, 1] *= central  # without the other side nothing is known of the gain
    np.testing.assert_allclose(found, whole, rtol=0.01, atol=1e-6)


def test_a_difference_at_which_most_runs_are_lost_is_taken_shorter(measured: np.ndarray) -> None:
    smooth = residuals(measured)

    def broken(vectors: np.ndarray, trials: np.ndarray) -> np.ndarray:
        values = smooth(vectors, trials)
        values[vectors[:, 1] > 0.21] = np.eye(1, len(TIMES_S)) * LOST
        return values

    one_sided = {"iterations": 0, "stepping": Stepping(central=False)}
    whole, found = fit(smooth, **one_sided).jacobian, fit(broken, **one_sided).jacobian
    np.testing.assert_allclose(found, whole, rtol=0.01, atol=1e-6)


def test_slopes_of_a_simulation_that_jitters_are_those_beyond_it(measured: np.ndarray) -> None:
    smooth = residuals(measured)

    def jittery(vectors: np.ndarray, trials: np.ndarray) -> np.ndarray:
        values = smooth(vectors, trials)
        for vector, some in zip(vectors, values, strict=True):
            seed = np.frombuffer(vector.tobytes(), np.uint32)
            some += np.random.default_rng(seed).normal(0, 1 / np.sqrt(len(TIMES_S)), some.shape)
        return values

    def steepness(evaluate, stepping: Stepping) -> np.ndarray:
        return np.linalg.norm(fit(evaluate, stepping=stepping).jacobian, axis=(0, 1))

    smoothly = steepness(smooth, Stepping())
    for most in (1, 2):
        found = steepness(jittery, Stepping(may_jitter=True, most=most)) / smoothly
        assert np.all((found > 2 / 3) & (found < 1.1))  # what moves trials counts a little less
    assert np.all(steepness(jittery, Stepping()) > 5 * smoothly)


def test_what_is_frozen_and_what_is_out_of_bounds_stays(measured: np.ndarray) -> None:
    found = fit(residuals(measured), start=(0.8, 0.65), free=np.array([True, False]))
    assert found.vector[1] == 0.65
    far = residuals(decays(np.array([[-0.5, 0.7]]))[0])
    assert fit(far).vector.min() >= 0.0


def test_a_known_fit_serves_the_first_step(measured: np.ndarray) -> None:
    asked = []

    def counted(vectors: np.ndarray, trials: np.ndarray) -> np.ndarray:
        asked.append(len(vectors))
        return residuals(measured)(vectors, trials)

    begun = fit(counted, iterations=1)
    asked.clear()
    gone_on = fit(counted, start=begun.vector, iterations=1, known=begun)
    assert len(asked) == 1
    assert gone_on.loss < begun.loss


def test_no_iteration_only_looks_at_the_start(measured: np.ndarray) -> None:
    looked = fit(residuals(measured), iterations=0)
    assert np.abs(looked.vector - [0.8, 0.2]).max() <= 0.02  # the best of the points it took
    assert looked.jacobian.shape == (len(STARTS_M), len(TIMES_S), 2)
    assert looked.loss > fit(residuals(measured), iterations=1).loss


def test_more_steps_for_each_jacobian_follow_a_curved_valley() -> None:
    def valley(vectors: np.ndarray, trials: np.ndarray) -> np.ndarray:
        """Return Rosenbrock's misses, without noise, for every trial the same."""
        x, y = 4.0 * vectors.T - 2.0
        misses = np.stack([1.0 - x, 10.0 * (y - x**2)], axis=-1)
        return np.repeat(misses[:, None], len(trials), axis=1)

    def found(most: int) -> Fit:
        stepping = Stepping(least_unit=0.01, nearer=0.25, most=most)
        prior = Prior(np.array([0.2, 0.5]), np.full(2, 10.0))
        return fit(valley, prior.mean, iterations=8, prior=prior, stepping=stepping)

    np.testing.assert_allclose(found(6).vector, 0.75, atol=1e-6)
    assert found(1).loss > 0.01
