"""Write the actions that policies choose from: what the arm can do of the grid `candidates`."""

from pathlib import Path

from omegaconf import DictConfig

from robotcast.build import action_space
from robotcast.casts.action import action_factors
from robotcast.casts.table import write_actions
from robotcast.rigs.envelope import feasible_actions
from robotcast.stage import bar, stage, tell


def candidates(config: DictConfig) -> None:
    space = action_space(config, "candidates")
    with bar("candidates") as progress:
        actions = feasible_actions(*space, progress)
    write_actions(list(map(action_factors, actions)), Path(config.paths.candidates))
    tell(f"{len(actions)} of {space[0].size} actions are feasible")


if __name__ == "__main__":
    stage(candidates)()
