"""How much real data the mixed dataset holds, chosen on real casts held out from training.

The paper takes "the best performing values" (paper, "Experiments"). Here they are judged by
forward models trained briefly on each mixture, on casts that none of them saw, each real cast once
(Stone 1974), and never on the targets that policies are tested on.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from robotcast.policies.learning.datasets import Dataset, folds, mixed_dataset
from robotcast.policies.learning.forward_model import Learner
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
    trials = list(product(pairs, held_out))
    logarithms: dict[tuple[float, float], list[np.ndarray]] = {pair: [] for pair in pairs}
    for done, (pair, (rest, out)) in enumerate(trials):
        fraction, weight = pair
        progress(done, len(trials), f"trying {fraction:.0%} real × {weight:g}")
        mixed = mixed_dataset(
            rest, simulated, real_fraction=fraction, real_weight=weight, seed=seed
        )
        model = learner.shortened(passes).fit(mixed, seed=seed)
        misses = np.linalg.norm(model.predict(out.actions) - out.endpoints_m, axis=1)
        logarithms[pair].append(np.log(np.maximum(misses, _LEAST_MISS_M)))
    progress(len(trials), len(trials))
    tried = [Mixture(*p, float(np.exp(np.concatenate(logarithms[p]).mean()))) for p in pairs]
    return tuple(sorted(tried, key=lambda m: m.held_out_miss_m or 0.0))
