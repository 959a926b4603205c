"""Choosing the casts that collect executes."""

from functools import partial
from pathlib import Path

from omegaconf import DictConfig

from robotcast.build import action_space
from robotcast.casts.action import Action
from robotcast.casts.table import read_actions
from robotcast.rigs.collect import choose_casts, number_extra_actions
from robotcast.rigs.envelope import are_feasible, feasible_actions
from robotcast.sessions import SESSION_FILE, read_session
from robotcast.stage import bar, tell


def chosen_casts(config: DictConfig, folder: Path) -> list[tuple[int, Action]]:
    """Return (action_id, action) of the casts that the session in `folder` shall hold.

    Raises ValueError for an action of a file that the arm cannot do.
    """
    grid, r0_m, limits, envelope = action_space(config, "collected")
    if config.collect.actions is None:
        with bar("feasible actions") as progress:
            feasible = feasible_actions(grid, r0_m, limits, envelope, progress)
        tell(f"{len(feasible)} of {grid.size} actions are feasible")
        size = config.scale.collect
        return choose_casts(feasible, size.casts, size.repeats, config.seed)
    can = partial(are_feasible, r0_m=r0_m, limits=limits, envelope=envelope)
    actions = read_actions(Path(config.collect.actions), can)
    stood = read_session(folder).casts if (folder / SESSION_FILE).is_file() else ()
    return number_extra_actions(actions, stood)
