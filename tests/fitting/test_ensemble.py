"""An ensemble finds where a fit should start, also where slopes of single vectors mislead."""

import numpy as np

from robotcast.fitting.least_squares import fit_robustly
from robotcast.fitting.starts import ensemble_start, hypercube

TRUE = np.array([0.3, 0.62, 0.45])
TRIALS = np.arange(6)
NOISE = 0.01
MEMBERS = hypercube(np.full(3, 0.5), 0.96, 40, seed=1)


def signal(vectors: np.ndarray, trials: np.ndarray) -> np.ndarray:
    """Return what is seen, (n_vectors, m, 12): smooth in every parameter, but not linear."""
    time = np.linspace(0.1, 1.0, 12)
    phase = 1 + trials[:, None] * 0.3 + time
    a, b, c = (vectors[:, k, None, None] for k in range(3))
    return a * np.sin(phase) + b**2 * time + np.exp(-c * phase) - 0.5 * a * c * np.cos(phase)


def missed(vectors: np.ndarray, trials: np.ndarray) -> np.ndarray:
    difference = signal(vectors, trials) - signal(TRUE[None], trials)
    return difference / np.sqrt(difference.shape[-1]) / NOISE


def rough(vectors: np.ndarray, trials: np.ndarray) -> np.ndarray:
    """Add ripples so narrow and steep that the slopes of a single vector say nothing."""
    away = (vectors - TRUE)[:, None, :]
    ripples = np.sin(away @ np.array([900.0, -700.0, 1100.0]) + trials) - np.sin(trials)
    return missed(vectors, trials) + 3 * ripples[..., None] / np.sqrt(12)


def test_it_centres_near_the_truth() -> None:
    start = ensemble_start(missed, MEMBERS, TRIALS, 6, seed=0)
    assert np.abs(start - TRUE).max() < 0.03


def test_ripples_that_trap_a_fit_do_not_trap_the_ensemble() -> None:
    steps = np.full(3, 0.02)
    alone = fit_robustly(rough, MEMBERS[0], steps, TRIALS, iterations=20)
    start = ensemble_start(rough, MEMBERS, TRIALS, 6, seed=0)
    assert np.abs(start - TRUE).max() < 0.06 < np.abs(alone.vector - TRUE).max()


def test_the_same_seed_moves_the_ensemble_alike() -> None:
    one, same, other = (ensemble_start(missed, MEMBERS, TRIALS, 2, seed) for seed in (3, 3, 4))
    assert one.tobytes() == same.tobytes()
    assert one.tobytes() != other.tobytes()


def test_trials_that_diverge_do_not_lead_it_astray() -> None:
    def lost(vectors: np.ndarray, trials: np.ndarray) -> np.ndarray:
        values = missed(vectors, trials)
        values[vectors[:, 0] > 0.7, 2] = 0.0
        values[vectors[:, 0] > 0.7, 2, 0] = 1e4
        return values

    start = ensemble_start(lost, MEMBERS, TRIALS, 6, seed=0)
    assert np.abs(start - TRUE).max() < 0.03
