"""Test the baseline Cast and Pull on the same targets, and as often, as the policies."""

from omegaconf import DictConfig

from robotcast.build import build, build_rig
from robotcast.casts.pull import plan_pull
from robotcast.stage import output_folder, stage
from robotcast.workflow.evaluating import cast_on_rig, chosen_targets, write_evaluation


def baseline(config: DictConfig) -> None:
    if "baseline" not in config.policy:
        raise ValueError(
            f"policy={config.policy.name} is no baseline; policy=cast_and_pull dataset=none is"
        )
    output_folder(config.paths.evaluation)  # tried before anything is cast
    rig = build_rig(config)
    choices = build(config.policy.baseline).choose(rig.cable, chosen_targets(config))
    write_evaluation(config, cast_on_rig(config, rig, choices, plan_pull))


if __name__ == "__main__":
    stage(baseline)()
