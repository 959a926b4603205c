"""Train one forward model on one dataset of one cable."""

from dataclasses import replace
from pathlib import Path

from hydra.utils import instantiate
from omegaconf import DictConfig
from stage import bar, console, output_folder, stage, unfinished_file

from robotcast.measurements.reader import read_measurement_set
from robotcast.measurements.split import split_by_action
from robotcast.policies.datasets import (
    Dataset,
    mixed_dataset,
    real_dataset,
    simulated_dataset,
)
from robotcast.policies.mixing import choose_mixture
from robotcast.policies.residual import ResidualLearner
from robotcast.policies.training import Learner


def train(config: DictConfig) -> None:
    if config.policy.name == "cast_and_pull":
        raise ValueError("policy=cast_and_pull learns nothing: evaluate it with dataset=none")
    learner = instantiate(config.policy.learner)
    datasets = _datasets(config, learner)
    folder = output_folder(config.paths.policy)
    with bar(f"train {config.policy.name}-{config.dataset.name}") as progress:
        model = learner.fit(
            *datasets,
            seed=config.seed,
            unfinished=unfinished_file(config, folder, ".pt"),
            progress=progress,
        )
    model.save(folder)
    console.print(f"{folder}: {sum(len(d.training) for d in datasets)} training examples")


def _datasets(config: DictConfig, learner: Learner | ResidualLearner) -> tuple[Dataset, ...]:
    if not isinstance(learner, ResidualLearner):
        return (_dataset(config, learner),)
    if config.dataset.name != "mixed":
        raise ValueError("policy=residual learns from D_real and D_sim: it needs dataset=mixed")
    return _real(config), _simulated(config)


def _dataset(config: DictConfig, learner: Learner) -> Dataset:
    kind = config.dataset
    if kind.name == "real":
        return _real(config)
    if kind.name == "simulated":
        return _simulated(config)
    if kind.name != "mixed":
        raise ValueError(f"dataset={kind.name} holds nothing to learn from")
    return _mixed(config, learner)


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
    mixed = mixed_dataset(
        real,
        simulated,
        real_fraction=best.real_fraction,
        real_weight=best.real_weight,
        seed=config.seed,
    )
    if best.held_out_miss_m is None:
        return mixed
    real_casts = len(real.training) + len(real.validation)
    console.print(
        f"mixture: {best.real_fraction:.0%} real, weight {best.real_weight:g}, the best of "
        f"{len(tried)} on {real_casts} held-out casts "
        f"({1000 * best.held_out_miss_m:.0f} mm)"
    )
    trials = [{**vars(m), "held_out_miss_m": round(m.held_out_miss_m or 0.0, 6)} for m in tried]
    held_out = {"held_out_real_casts": real_casts, "mixtures": trials}
    return replace(mixed, facts={**mixed.facts, **held_out})


def _values(given: object) -> list[float]:
    return [float(v) for v in given] if hasattr(given, "__iter__") else [float(given)]  # type: ignore


def _real(config: DictConfig) -> Dataset:
    measured = read_measurement_set(Path(config.paths.measurements))
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


if __name__ == "__main__":
    stage(train)()
