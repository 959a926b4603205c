"""How much real data the mixed dataset holds, chosen on real casts held out from training.

The paper takes "the best performing values" (paper, "Experiments"). Here they are judged by
forward models trained briefly on each mixture, on casts that none of them saw, each real cast once
(Stone 1974), and never on the targets that policies are tested on.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from robotcast.policies.datasets import Dataset, Examples, folds, mixed_dataset
from robotcast.policies.training import Learner
from robotcast.processes import cores, parallel_map
from robotcast.progress import Progress, silent

_FOLDS = 3
_LEAST_MISS_M = 1e-3  # a miss below what tracking can tell counts as this


@dataclass(frozen=True)
class Mixture:
    """How to mix real and simulated casts: real part of the examples, weight of each in the loss.

    `held_out_miss_m` is the geometric mean of the misses on held-out real casts; None when not
    tried.
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

    Forward models trained for so many `passes` are judged by the geometric mean of their misses:
    like the median it does not let the few whip-like casts decide, and it is less noisy where few
    casts are held out. Too few real actions tell nothing: then the pairs come as they were given.
    """
    pairs = [Mixture(*pair) for pair in product(fractions, weights)]
    if not pairs:
        raise ValueError("dataset mixed: real_fraction and real_weight need a value each")
    held_out = list(folds(real, _FOLDS, seed=seed))
    if len(pairs) == 1 or not held_out:
        return tuple(pairs)
    brief = learner.shortened(passes)
    trials = [(brief, seed, simulated, pair, *fold) for pair in pairs for fold in held_out]
    logarithms: dict[Mixture, list[np.ndarray]] = {pair: [] for pair in pairs}
    progress(0, len(trials))
    found = parallel_map(_log_misses, trials, cores(0))  # a small network keeps one core busy
    for done, ((_, _, _, pair, *_), misses) in enumerate(zip(trials, found, strict=True), 1):
        logarithms[pair].append(misses)
        note = f"tried {pair.real_fraction:.0%} real × {pair.real_weight:g}"
        progress(done, len(trials), note)
    means = {pair: float(np.concatenate(logarithms[pair]).mean()) for pair in pairs}
    ranked = sorted(pairs, key=means.__getitem__)
    return tuple(replace(pair, held_out_miss_m=float(np.exp(means[pair]))) for pair in ranked)


def _log_misses(
    trial: tuple[Learner, int, Dataset, Mixture, Dataset, Examples],
) -> np.ndarray:
    """Learn one mixture without a fold; return the logarithms of the misses on that fold, (n,)."""
    learner, seed, simulated, pair, rest, held_out = trial
    shares = {"real_fraction": pair.real_fraction, "real_weight": pair.real_weight}
    mixed = mixed_dataset(rest, simulated, **shares, seed=seed)
    model = learner.fit(mixed, seed=seed)
    misses = np.linalg.norm(model.predict(held_out.actions) - held_out.endpoints_m, axis=1)
    return np.log(np.maximum(misses, _LEAST_MISS_M))
