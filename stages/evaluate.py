"""Test one policy: its choice for every target, cast on the rig as often as the scale says."""

from functools import partial
from pathlib import Path

import numpy as np
import polars as pl
from casting import cast_on_rig, chosen_targets, write_evaluation
from grids import build_envelope, build_grid, build_limits
from hydra.utils import instantiate
from omegaconf import DictConfig
from rigs import build_rig
from stage import console, stage

from robotcast.casts.action_file import read_actions
from robotcast.measurements.reader import read_measurement_set
from robotcast.measurements.split import split_by_action
from robotcast.policies.choosing import (
    Neighbourhood,
    choose_actions,
    refine_choices,
    with_spread,
)
from robotcast.policies.evaluation import Subject, predicted_table
from robotcast.policies.forward_model import ForwardModel
from robotcast.rigs.envelope import are_feasible


def evaluate(config: DictConfig) -> None:
    if "learner" not in config.policy:
        raise ValueError(f"policy={config.policy.name} is no forward model: stages/baseline.py")
    model = instantiate(config.policy.learner).load(Path(config.paths.policy))
    recorded = config.rig.name == "recorded"
    write_evaluation(config, (_predicted if recorded else _executed)(config, model))


def _executed(config: DictConfig, model: ForwardModel) -> pl.DataFrame:
    rig, limits, envelope = build_rig(config), build_limits(config), build_envelope(config)
    _refuse_other_cable(model, rig.cable.name)
    feasible = partial(are_feasible, r0_m=rig.r0_m, limits=limits, envelope=envelope)
    caution = config.evaluate.caution
    choices = choose_actions(model, _candidates(config), chosen_targets(config), caution)
    about = Neighbourhood(build_grid(config, "candidates"), rig.r0_m, limits)
    refined = refine_choices(model, choices, about, feasible)
    return cast_on_rig(config, rig, with_spread(model, refined))


def _candidates(config: DictConfig) -> np.ndarray:
    path = Path(config.paths.candidates)
    if not path.is_file():
        raise ValueError(f"{path}: there is no such file; python stages/candidates.py writes it")
    return np.array([action.as_array() for action in read_actions(path)])


def _predicted(config: DictConfig, model: ForwardModel) -> pl.DataFrame:
    measured = read_measurement_set(Path(config.paths.measurements))
    _refuse_other_cable(model, measured.cable.name)
    sizes = config.scale.tune
    _, held_out = split_by_action(measured, sizes.tune_casts, sizes.test_casts, config.seed)
    console.print("a recorded set cannot cast: endpoints of held-out casts are predicted instead")
    subject = Subject(measured.rig, measured.cable, config.policy.name, config.dataset.name)
    return predicted_table(subject, model, held_out)


def _refuse_other_cable(model: ForwardModel, cable: str) -> None:
    known = model.facts.get("cable", cable)
    if known != cable:
        raise ValueError(f"the policy learned from casts of {known}, the rig holds {cable}")


if __name__ == "__main__":
    stage(evaluate)()
