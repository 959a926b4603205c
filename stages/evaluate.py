"""Test one policy: its choice for every target, cast on the rig as often as the scale says."""

from functools import partial
from pathlib import Path

import polars as pl
import yaml
from grids import build_envelope, build_grid, build_limits
from hydra.utils import instantiate
from omegaconf import DictConfig, OmegaConf
from rigs import build_rig
from stage import bar, console, output_folder, stage

from robotcast.casts.grid import are_feasible
from robotcast.files import atomic_file
from robotcast.measurements.reader import read_measurement_set
from robotcast.measurements.split import split_by_action
from robotcast.policies.choice import choose_actions
from robotcast.policies.datasets import read_simulated
from robotcast.policies.evaluation import (
    Subject,
    execute_choices,
    executed_table,
    predicted_table,
)
from robotcast.policies.forward_model import ForwardModel
from robotcast.policies.refinement import Neighbourhood, refine_choices
from robotcast.policies.targets import Board, spread_targets


def evaluate(config: DictConfig) -> None:
    model = instantiate(config.policy.learner).load(Path(config.paths.policy))
    recorded = config.rig.name == "recorded"
    table = _predicted(config, model) if recorded else _executed(config, model)
    folder = output_folder(config.paths.evaluation)
    with atomic_file(folder / "evaluation.csv") as temporary:
        table.write_csv(temporary)
    median = table["error_percent"].median()
    shown = "no endpoint tracked" if median is None else f"median {median:.1f} % of cable length"
    console.print(f"{folder}: {len(table)} casts, {shown}")


def _executed(config: DictConfig, model: ForwardModel) -> pl.DataFrame:
    rig = build_rig(config)
    simulated = read_simulated(Path(config.paths.simulated) / "casts.parquet")
    targets = spread_targets(
        simulated.endpoints_m, config.scale.evaluate.targets, Board(**config.camera.board)
    )
    limits, envelope = build_limits(config), build_envelope(config)
    feasible = partial(are_feasible, r0_m=rig.r0_m, limits=limits, envelope=envelope)
    grid = build_grid(config, "candidates")
    choices = choose_actions(model, grid.candidates(rig.r0_m, limits), targets, feasible)
    choices = refine_choices(
        model, choices, Neighbourhood.of(grid, rig.r0_m, limits), feasible
    )
    for target, choice in enumerate(choices):
        if not choice.reachable:
            console.print(f"target {target}: {choice.out_of_reach()}", style="yellow")
    with bar(f"evaluate {config.policy.name}-{config.dataset.name}") as progress:
        executed = execute_choices(
            rig,
            choices,
            config.scale.evaluate.repeats,
            Path(config.paths.evaluation_sessions),
            _rig_settings(config),
            limits,
            progress,
        )
    for (target, repeat), reason in executed.lost.items():
        console.print(f"lost: target {target}, cast {repeat}: {reason}", style="yellow")
    subject = Subject(rig.name, rig.cable, config.policy.name, config.dataset.name)
    return executed_table(subject, choices, executed)


def _predicted(config: DictConfig, model: ForwardModel) -> pl.DataFrame:
    measured = read_measurement_set(Path(config.paths.measurements))
    sizes = config.scale.tune
    _, held_out = split_by_action(measured, sizes.tune_casts, sizes.test_casts, config.seed)
    console.print("a recorded set cannot cast: endpoints of held-out casts are predicted instead")
    subject = Subject(measured.rig, measured.cable, config.policy.name, config.dataset.name)
    return predicted_table(subject, model, held_out)


def _rig_settings(config: DictConfig) -> str:
    """Everything in the config that decides what a cast does, as text."""
    plain = OmegaConf.to_container(config, resolve=True)
    assert isinstance(plain, dict)
    parts = {name: plain[name] for name in ("rig", "cable", "camera", "casts", "seed")}
    parts["rig"].pop("workers", None)
    return yaml.safe_dump(parts)


if __name__ == "__main__":
    stage(evaluate)()
