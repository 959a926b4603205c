"""Test one policy: its choice for every target, cast on the rig as often as the scale says."""

from pathlib import Path

from hydra.utils import instantiate
from omegaconf import DictConfig

from robotcast.build import build_rig
from robotcast.stage import output_folder, stage
from robotcast.workflow.evaluating import cast_on_rig, choose, predict_held_out, write_evaluation


def evaluate(config: DictConfig) -> None:
    if "learner" not in config.policy:
        raise ValueError(f"policy={config.policy.name} is no forward model: stages/baseline.py")
    output_folder(config.paths.evaluation)  # tried before anything is cast
    model = instantiate(config.policy.learner).load(Path(config.paths.policy))
    if config.rig.name == "recorded":
        table = predict_held_out(config, model)
    else:
        rig = build_rig(config)
        table = cast_on_rig(config, rig, choose(config, rig, model))
    write_evaluation(config, table)


if __name__ == "__main__":
    stage(evaluate)()
