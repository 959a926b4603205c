"""Collect casts into the session folder: those of the chosen actions that it does not hold.

The actions are drawn from the collected grid, or read: collect.actions=FILE
"""

from pathlib import Path

import numpy as np
from grids import build_envelope, build_limits, filtered_grid
from omegaconf import DictConfig
from rigs import build_rig
from stage import bar, console, named_session, output_folder, stage

from robotcast.casts.action import Action
from robotcast.casts.action_file import read_actions
from robotcast.rigs.collect import choose_casts, collect_casts, number_extra_actions
from robotcast.rigs.envelope import are_feasible
from robotcast.sessions import SESSION_FILE, adopt_recorded_set, read_session


def collect(config: DictConfig) -> None:
    folder = output_folder(str(named_session(config)))
    if config.rig.name == "recorded":
        if config.collect.actions is not None:
            raise ValueError("rig=recorded cannot cast the actions of collect.actions")
        measured = adopt_recorded_set(config.rig.path and Path(config.rig.path), folder)
        console.print(f"{folder}: {len(measured.trials)} recorded casts, nothing to execute")
        return
    rig = build_rig(config)
    if config.collect.actions is None:
        chosen = _drawn(config)
    else:
        chosen = _given(config, Path(config.collect.actions), folder)
    if config.rig.get("dry_run"):
        from dry_run import show_dry_run

        show_dry_run(config, rig, [action for _, action in chosen], folder)
        return
    with bar(f"collect {rig.cable.name}") as progress:
        collected = collect_casts(rig, chosen, folder, build_limits(config), progress)
    for number, reason in collected.failed.items():
        console.print(f"cast {number} failed: {reason}", style="yellow", markup=False)
    console.print(
        f"{folder}: {collected.added} casts added to {collected.stood}, "
        f"{len(collected.failed)} failed"
    )


def _drawn(config: DictConfig) -> list[tuple[int, Action]]:
    """Return actions of the collected grid, some of them repeated."""
    with bar("feasible actions") as progress:
        actions, report = filtered_grid(config, progress, grid="collected")
    console.print(f"{report.feasible} of {report.candidates} actions are feasible")
    size = config.scale.collect
    return choose_casts(actions, size.casts, size.repeats, config.seed)


def _given(config: DictConfig, path: Path, folder: Path) -> list[tuple[int, Action]]:
    """Return the actions of a file; refuse one that the arm cannot do."""
    actions = read_actions(path)
    rows = np.array([action.as_array() for action in actions])
    limits = build_limits(config)
    feasible = are_feasible(rows, config.casts.r0_m, limits, build_envelope(config))
    if not feasible.all():
        line = 2 + int(np.argmin(feasible))
        raise ValueError(f"{path} line {line}: the arm cannot do this action or its mirror image")
    stood = read_session(folder).casts if (folder / SESSION_FILE).is_file() else ()
    return number_extra_actions(actions, stood)


if __name__ == "__main__":
    stage(collect)()
