"""Test the baseline Cast and Pull on the same targets, and as often, as the policies."""

from casting import cast_on_rig, chosen_targets, write_evaluation
from hydra.utils import instantiate
from omegaconf import DictConfig
from rigs import build_rig
from stage import stage

from robotcast.casts.pull import plan_pull


def baseline(config: DictConfig) -> None:
    if "baseline" not in config.policy:
        raise ValueError(
            f"policy={config.policy.name} is no baseline; policy=cast_and_pull dataset=none is"
        )
    rig = build_rig(config)
    choices = instantiate(config.policy.baseline).choose(rig.cable, chosen_targets(config))
    write_evaluation(config, cast_on_rig(config, rig, choices, plan_pull))


if __name__ == "__main__":
    stage(baseline)()
