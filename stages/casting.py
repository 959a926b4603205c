"""Casting what a policy chose on the configured rig, for the stages that test policies."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import polars as pl
import yaml
from grids import build_limits
from omegaconf import DictConfig, OmegaConf
from stage import bar, console, output_folder

from robotcast.casts.plan import plan_action
from robotcast.files import atomic_file
from robotcast.policies.choosing import Choice
from robotcast.policies.datasets import read_simulated
from robotcast.policies.evaluation import Subject, execute_choices, executed_table
from robotcast.policies.targets import Board, read_targets, spread_targets
from robotcast.rigs.collect import Plan
from robotcast.rigs.rig import Rig


def chosen_targets(config: DictConfig) -> np.ndarray:
    """Return the targets (k, 2) that every policy of the configured cable is tested on."""
    board = Board(**config.camera.board)
    if config.evaluate.targets is not None:
        return read_targets(Path(config.evaluate.targets), board)
    simulated = read_simulated(Path(config.paths.targets) / "casts.parquet")
    count = config.scale.evaluate.targets
    return spread_targets(simulated.endpoints_m, count, board)


def cast_on_rig(
    config: DictConfig, rig: Rig, choices: Sequence[Choice], plan: Plan = plan_action
) -> pl.DataFrame:
    """Cast every choice as often as the scale says; return evaluation.csv."""
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
            build_limits(config),
            progress,
            plan=plan,
        )
    for (target, repeat), reason in executed.lost.items():
        console.print(f"lost: target {target}, cast {repeat}: {reason}", style="yellow")
    subject = Subject(rig.name, rig.cable, config.policy.name, config.dataset.name)
    return executed_table(subject, choices, executed)


def write_evaluation(config: DictConfig, table: pl.DataFrame) -> None:
    """Write evaluation.csv and say how it went."""
    folder = output_folder(config.paths.evaluation)
    with atomic_file(folder / "evaluation.csv") as temporary:
        table.write_csv(temporary)
    median = table["error_percent"].median()
    shown = "no endpoint tracked" if median is None else f"median {median:.1f} % of cable length"
    console.print(f"{folder}: {len(table)} casts, {shown}")


def _rig_settings(config: DictConfig) -> str:
    """Everything in the config that decides what a cast does, as text."""
    plain = OmegaConf.to_container(config, resolve=True)
    assert isinstance(plain, dict)
    parts = {name: plain[name] for name in ("rig", "cable", "camera", "casts", "seed")}
    parts["rig"].pop("workers", None)
    return yaml.safe_dump(parts)
