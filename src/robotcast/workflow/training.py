"""The data that the configured dataset gives a learner, and how real and simulated ones mix.

The paper takes "the best performing values" (paper, "Experiments"). Here mixtures are judged by
forward models trained briefly on each, on casts that none of them saw, each real cast once (Stone
1974), and never on the targets that policies are tested on.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np
from omegaconf import DictConfig

from robotcast.measurements.measurement_set import split_by_action
from robotcast.policies.datasets import (
    Dataset,
    Examples,
    folds,
    mixed_dataset,
    real_dataset,
    simulated_dataset,
)
from robotcast.policies.residual import ResidualLearner
from robotcast.policies.training import Learner
from robotcast.processes import cores, parallel_map
from robotcast.running import Progress, silent
from robotcast.stage import bar, measured_set, tell

FOLDS = 3
LEAST_MISS_M = 1e-3  # a miss below what tracking can tell counts as this


def training_data(config: DictConfig, learner: Learner | ResidualLearner) -> tuple[Dataset, ...]:
    """Return what `learner.fit` takes: one dataset, or D_real and D_sim for a residual learner."""
    kind = config.dataset.name
    if isinstance(learner, ResidualLearner):
        if kind != "mixed":
            raise ValueError("policy=residual learns from D_real and D_sim: it needs dataset=mixed")
        return _real(config), _simulated(config)
    if kind == "mixed":
        return (_mixed(config, learner),)
    if kind not in ("real", "simulated"):
        raise ValueError(f"dataset={kind} holds nothing to learn from")
    return (_real(config) if kind == "real" else _simulated(config),)


def _mixed(config: DictConfig, learner: Learner) -> Dataset:
    """Mix as held-out real casts like it best."""
    real, simulated, kind = _real(config), _simulated(config), config.dataset
    with bar(f"mix {config.policy.name}") as progress:
        tried = choose_mixture(
            learner,
            real,
            simulated,
            fractions=np.ravel(kind.real_fraction).astype(float).tolist(),
            weights=np.ravel(kind.real_weight).astype(float).tolist(),
            passes=kind.trial_passes,
            seed=config.seed,
            progress=progress,
        )
    best = tried[0]
    shares = {"real_fraction": best.real_fraction, "real_weight": best.real_weight}
    mixed = mixed_dataset(real, simulated, **shares, seed=config.seed)
    if best.held_out_miss_m is None:
        return mixed
    casts = len(real.training) + len(real.validation)
    tell(
        f"mixture: {best.real_fraction:.0%} real, weight {best.real_weight:g}, the best of "
        f"{len(tried)} on {casts} held-out casts ({1000 * best.held_out_miss_m:.0f} mm)"
    )
    trials = [{**vars(m), "held_out_miss_m": round(m.held_out_miss_m or 0.0, 6)} for m in tried]
    facts = {**mixed.facts, "held_out_real_casts": casts, "mixtures": trials}
    return replace(mixed, facts=facts)


def _real(config: DictConfig) -> Dataset:
    measured = measured_set(config.paths.measurements)
    sizes = config.scale.tune
    tuning, test = split_by_action(measured, sizes.tune_casts, sizes.test_casts, config.seed)
    return real_dataset(
        measured,
        [t.trial for t in test.trials],
        validation_fraction=config.dataset.validation_fraction,
        seed=config.seed,
        casts=config.dataset.casts,
        first=[t.trial for t in tuning.trials],
    )


def _simulated(config: DictConfig) -> Dataset:
    return simulated_dataset(
        Path(config.paths.simulated) / "casts.parquet",
        validation_fraction=config.dataset.validation_fraction,
        seed=config.seed,
    )


@dataclass(frozen=True)
class Mixture:
    """How to mix real and simulated casts."""

    real_fraction: float  # of the examples
    real_weight: float  # of each in the loss
    held_out_miss_m: float | None = None  # geometric mean on real casts; None when not tried


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
    held_out = list(folds(real, FOLDS, seed=seed))
    if len(pairs) == 1 or not held_out:
        return tuple(pairs)
    brief = learner.shortened(passes)
    trials = [(brief, seed, simulated, pair, *fold) for pair in pairs for fold in held_out]
    logarithms: dict[Mixture, list[np.ndarray]] = {pair: [] for pair in pairs}
    progress(0, len(trials))
    found = parallel_map(_log_misses, trials, cores(0))  # a small network keeps one core busy
    for done, ((_, _, _, pair, *_), misses) in enumerate(zip(trials, found, strict=True), 1):
        logarithms[pair].append(misses)
        progress(done, len(trials), f"tried {pair.real_fraction:.0%} real × {pair.real_weight:g}")
    means = {pair: float(np.concatenate(logarithms[pair]).mean()) for pair in pairs}
    ranked = sorted(pairs, key=means.__getitem__)
    return tuple(replace(pair, held_out_miss_m=float(np.exp(means[pair]))) for pair in ranked)


def _log_misses(trial: tuple[Learner, int, Dataset, Mixture, Dataset, Examples]) -> np.ndarray:
    """Learn one mixture without a fold; return the logarithms of the misses on that fold, (n,)."""
    learner, seed, simulated, pair, rest, held_out = trial
    shares = {"real_fraction": pair.real_fraction, "real_weight": pair.real_weight}
    mixed = mixed_dataset(rest, simulated, **shares, seed=seed)
    model = learner.fit(mixed, seed=seed)
    misses = np.linalg.norm(model.predict(held_out.actions) - held_out.endpoints_m, axis=1)
    return np.log(np.maximum(misses, LEAST_MISS_M))
