"""Testing policies on the configured rig, or on the held-out casts of a recorded set."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
import polars as pl
import yaml
from omegaconf import DictConfig, OmegaConf

from robotcast.build import action_space, build
from robotcast.casts.table import read_actions
from robotcast.files import write_text
from robotcast.measurements.measurement_set import split_by_action
from robotcast.policies import choosing
from robotcast.policies.datasets import read_simulated
from robotcast.policies.evaluation import Subject, execute_choices, executed_table, predicted_table
from robotcast.policies.forward_model import ForwardModel
from robotcast.policies.targets import Board, read_targets, spread_targets
from robotcast.rigs import Rig
from robotcast.rigs.collect import Plan
from robotcast.rigs.envelope import are_feasible
from robotcast.stage import bar, measured_set, output_folder, tell, warn


def chosen_targets(config: DictConfig) -> np.ndarray:
    """Return the targets (k, 2) [m] that every policy of the configured cable is tested on."""
    board = Board(**config.camera.board)
    if config.evaluate.targets is not None:
        return read_targets(Path(config.evaluate.targets), board)
    simulated = read_simulated(Path(config.paths.targets) / "casts.parquet")
    return spread_targets(simulated.endpoints_m, config.scale.evaluate.targets, board)


def choose(config: DictConfig, rig: Rig, model: ForwardModel) -> Sequence[choosing.Choice]:
    """Return the model's choice for every target, moved towards it along the model's gradient."""
    _refuse_other_cable(model, rig.cable.name)
    path = Path(config.paths.candidates)
    if not path.is_file():
        raise ValueError(f"{path}: there is no such file; python stages/candidates.py writes it")
    candidates = np.array([action.as_array() for action in read_actions(path)])
    targets, caution = chosen_targets(config), config.evaluate.caution
    choices = choosing.choose_actions(model, candidates, targets, caution)
    grid, _, limits, envelope = action_space(config, "candidates")
    feasible = partial(are_feasible, r0_m=rig.r0_m, limits=limits, envelope=envelope)
    about = choosing.Neighbourhood(grid, rig.r0_m, limits)
    return choosing.with_spread(model, choosing.refine_choices(model, choices, about, feasible))


def cast_on_rig(
    config: DictConfig, rig: Rig, choices: Sequence[choosing.Choice], plan: Plan
) -> pl.DataFrame:
    """Cast every choice as often as the scale says; return evaluation.csv."""
    for target, choice in enumerate(choices):
        if not choice.reachable:
            warn(f"target {target}: {choice.out_of_reach()}")
    plain = OmegaConf.to_container(config, resolve=True)
    assert isinstance(plain, dict)
    decides = {name: plain[name] for name in ("rig", "cable", "camera", "casts", "seed")}
    for settings in (decides["rig"], decides["rig"]["build"]):
        settings.pop("workers", None)
    with bar(f"evaluate {config.policy.name}-{config.dataset.name}") as progress:
        executed = execute_choices(
            rig,
            choices,
            config.scale.evaluate.repeats,
            Path(config.paths.evaluation_sessions),
            yaml.safe_dump(decides),
            build(config.casts.limits),
            progress,
            plan=plan,
        )
    for (target, repeat), reason in executed.lost.items():
        warn(f"lost: target {target}, cast {repeat}: {reason}")
    subject = Subject(rig.name, rig.cable, config.policy.name, config.dataset.name)
    return executed_table(subject, choices, executed)


def predict_held_out(config: DictConfig, model: ForwardModel) -> pl.DataFrame:
    """Predict the held-out casts of a recorded set; return evaluation.csv."""
    measured = measured_set(config.paths.measurements)
    _refuse_other_cable(model, measured.cable.name)
    sizes = config.scale.tune
    _, held_out = split_by_action(measured, sizes.tune_casts, sizes.test_casts, config.seed)
    tell("a recorded set cannot cast: endpoints of held-out casts are predicted instead")
    subject = Subject(measured.rig, measured.cable, config.policy.name, config.dataset.name)
    return predicted_table(subject, model, held_out)


def write_evaluation(config: DictConfig, table: pl.DataFrame) -> None:
    """Write evaluation.csv and say how it went."""
    folder = output_folder(config.paths.evaluation)
    write_text(folder / "evaluation.csv", table.write_csv())
    median = table["error_percent"].median()
    shown = "no endpoint tracked" if median is None else f"median {median:.1f} % of cable length"
    tell(f"{folder}: {len(table)} casts, {shown}")


def _refuse_other_cable(model: ForwardModel, cable: str) -> None:
    known = model.facts.get("cable", cable)
    if known != cable:
        raise ValueError(f"the policy learned from casts of {known}, the rig holds {cable}")
