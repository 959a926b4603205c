"""How much real data the mixed dataset holds, chosen on real casts held out from training.

The paper takes "the best performing values" (paper, "Experiments"). Here they are judged by
forward models trained briefly on each mixture, on casts that none of them saw, each real cast once
(Stone 1974), and never on the targets that policies are tested on.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from robotcast.policies.learning.datasets import Dataset, Examples, folds, mixed_dataset
from robotcast.policies.learning.forward_model import Learner
from robotcast.processes import cores, parallel_map
from robotcast.progress import Progress, silent

_FOLDS = 3
_LEAST_MISS_M = 1e-3  # a miss below what tracking can tell counts as this


@dataclass(frozen=True)
class Mixture:
    """One way to mix.

    Attributes
    ----------
    real_fraction : of the training examples; `real_weight` : of a real example in the loss.
    held_out_miss_m : geometric mean of the misses on held-out real casts; None when not tried.
    """

    real_fraction: float
    real_weight: float
    held_out_miss_m: float | None = None


def choose_mixture(
    learner: Learner,
    real: Dataset,
    simulated: Dataset,
    *,
    fractions: Sequence[float],
    weights: Sequence[float],
    passes: int,
    seed: int,
    progress: Progress = silent,
) -> tuple[Mixture, ...]:
    """Try every pair of a fraction and a weight; return all, the best first.

    Too few real actions tell nothing of it: then the pairs come as they were given.

    The geometric mean of the misses counts: like the median it does not let the few whip-like
    casts decide, and it is less noisy where few casts are held out.

    Parameters
    ----------
    passes : of each trial's training.
    """
    pairs = list(product(fractions, weights))
    if not pairs:
        raise ValueError("dataset mixed: real_fraction and real_weight need a value each")
    held_out = list(folds(real, _FOLDS, seed=seed))
    if len(pairs) == 1 or not held_out:
        return tuple(Mixture(*pair) for pair in pairs)
    brief = learner.shortened(passes)
    trials = [
        _Trial(brief, rest, simulated, out, *pair, seed)
        for pair, (rest, out) in product(pairs, held_out)
    ]
    logarithms: dict[tuple[float, float], list[np.ndarray]] = {pair: [] for pair in pairs}
    progress(0, len(trials))
    misses = parallel_map(_log_misses, trials, cores(0))  # a small network keeps one core busy
    for done, (trial, found) in enumerate(zip(trials, misses, strict=True), 1):
        logarithms[trial.real_fraction, trial.real_weight].append(found)
        said = f"tried {trial.real_fraction:.0%} real × {trial.real_weight:g}"
        progress(done, len(trials), said)
    tried = [Mixture(*p, float(np.exp(np.concatenate(logarithms[p]).mean()))) for p in pairs]
    return tuple(sorted(tried, key=lambda m: m.held_out_miss_m or 0.0))


@dataclass(frozen=True)
class _Trial:
    """One mixture to be learned without one fold of the real casts."""

    learner: Learner
    rest: Dataset
    simulated: Dataset
    held_out: Examples
    real_fraction: float
    real_weight: float
    seed: int


def _log_misses(trial: _Trial) -> np.ndarray:
    """Return the logarithms of the misses on the casts held out."""
    mixed = mixed_dataset(
        trial.rest,
        trial.simulated,
        real_fraction=trial.real_fraction,
        real_weight=trial.real_weight,
        seed=trial.seed,
    )
    model = trial.learner.fit(mixed, seed=trial.seed)
    out = trial.held_out
    misses = np.linalg.norm(model.predict(out.actions) - out.endpoints_m, axis=1)
    return np.log(np.maximum(misses, _LEAST_MISS_M))
