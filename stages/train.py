"""Train one forward model on one dataset of one cable."""

from hydra.utils import instantiate
from omegaconf import DictConfig

from robotcast.stage import bar, output_folder, stage, tell, unfinished_file
from robotcast.workflow.training import training_data


def train(config: DictConfig) -> None:
    if config.policy.name == "cast_and_pull":
        raise ValueError("policy=cast_and_pull learns nothing: evaluate it with dataset=none")
    learner = instantiate(config.policy.learner)
    datasets = training_data(config, learner)
    folder = output_folder(config.paths.policy)
    with bar(f"train {config.policy.name}-{config.dataset.name}") as progress:
        model = learner.fit(
            *datasets,
            seed=config.seed,
            unfinished=unfinished_file(config, folder, ".pt"),
            progress=progress,
        )
    model.save(folder)
    tell(f"{folder}: {sum(len(d.training) for d in datasets)} training examples")


if __name__ == "__main__":
    stage(train)()
