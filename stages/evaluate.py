"""Test a policy or the baseline: its choice for every target, cast on the rig as the scale says."""

from pathlib import Path

from hydra.utils import instantiate
from omegaconf import DictConfig

from robotcast.build import build, build_rig
from robotcast.casts.plan import plan_action, plan_pull
from robotcast.stage import output_folder, stage
from robotcast.workflow import evaluating


def evaluate(config: DictConfig) -> None:
    output_folder(config.paths.evaluation)  # tried before anything is cast
    if "baseline" in config.policy:  # it learned nothing
        rig, plan = build_rig(config), plan_pull
        choices = build(config.policy.baseline).choose(rig.cable, evaluating.chosen_targets(config))
    else:
        model = instantiate(config.policy.learner).load(Path(config.paths.policy))
        if config.rig.name == "recorded":
            return evaluating.write_evaluation(config, evaluating.predict_held_out(config, model))
        rig, plan = build_rig(config), plan_action
        choices = evaluating.choose(config, rig, model)
    evaluating.write_evaluation(config, evaluating.cast_on_rig(config, rig, choices, plan))


if __name__ == "__main__":
    stage(evaluate)()
