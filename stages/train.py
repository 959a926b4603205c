"""Train one forward model on one dataset of one cable."""

from pathlib import Path

from hydra.utils import instantiate
from omegaconf import DictConfig
from stage import bar, console, output_folder, stage

from robotcast.measurements.reader import read_measurement_set
from robotcast.measurements.split import split_by_action
from robotcast.policies.datasets import (
    Dataset,
    mixed_dataset,
    real_dataset,
    simulated_dataset,
)


def train(config: DictConfig) -> None:
    dataset = _dataset(config)
    with bar(f"train {config.policy.name}-{config.dataset.name}") as progress:
        model = instantiate(config.policy.learner).fit(dataset, seed=config.seed, progress=progress)
    folder = output_folder(config.paths.policy)
    model.save(folder)
    console.print(f"{folder}: {len(dataset.training)} training examples")


def _dataset(config: DictConfig) -> Dataset:
    kind = config.dataset
    if kind.name == "real":
        return _real(config)
    if kind.name == "simulated":
        return _simulated(config)
    return mixed_dataset(
        _real(config),
        _simulated(config),
        real_fraction=kind.real_fraction,
        real_weight=kind.real_weight,
        seed=config.seed,
    )


def _real(config: DictConfig) -> Dataset:
    measured = read_measurement_set(Path(config.paths.measurements))
    sizes = config.scale.tune
    _, test = split_by_action(measured, sizes.tune_casts, sizes.test_casts, config.seed)
    return real_dataset(
        measured,
        [t.trial for t in test.trials],
        validation_fraction=config.dataset.validation_fraction,
        seed=config.seed,
    )


def _simulated(config: DictConfig) -> Dataset:
    return simulated_dataset(
        Path(config.paths.simulated) / "casts.parquet",
        validation_fraction=config.dataset.validation_fraction,
        seed=config.seed,
    )


if __name__ == "__main__":
    stage(train)()
