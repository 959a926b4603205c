"""Write the actions that policies choose from: what the arm can do of the grid `candidates`."""

from pathlib import Path

from grids import filtered_grid
from omegaconf import DictConfig
from stage import bar, console, stage

from robotcast.casts.action import ACTION_COLUMNS
from robotcast.casts.action_file import write_actions


def candidates(config: DictConfig) -> None:
    with bar("candidates") as progress:
        actions, report = filtered_grid(config, progress, grid="candidates")
    write_actions(
        [dict(zip(ACTION_COLUMNS, row, strict=True)) for row in actions.tolist()],
        Path(config.paths.candidates),
    )
    console.print(f"{report.feasible} of {report.candidates} actions are feasible")


if __name__ == "__main__":
    stage(candidates)()
