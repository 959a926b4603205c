"""The data that the configured dataset gives a learner."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, ListConfig

from robotcast.measurements.split import split_by_action
from robotcast.policies.datasets import Dataset, mixed_dataset, real_dataset, simulated_dataset
from robotcast.policies.mixing import choose_mixture
from robotcast.policies.residual import ResidualLearner
from robotcast.policies.training import Learner
from robotcast.stage import bar, measured_set, tell


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
            fractions=_values(kind.real_fraction),
            weights=_values(kind.real_weight),
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


def _values(given: Any) -> list[float]:
    return [float(value) for value in (given if isinstance(given, ListConfig) else [given])]


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
