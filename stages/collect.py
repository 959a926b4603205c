"""Collect casts into the session folder: those of the chosen actions that it does not hold."""

from pathlib import Path

from grids import build_limits, filtered_grid
from omegaconf import DictConfig
from rigs import build_rig
from stage import bar, console, output_folder, stage

from robotcast.rigs.collect import choose_casts, collect_casts
from robotcast.rigs.recorded import adopt_recorded_set


def collect(config: DictConfig) -> None:
    folder = output_folder(config.paths.sessions)
    if config.rig.name == "recorded":
        measured = adopt_recorded_set(config.rig.path and Path(config.rig.path), folder)
        console.print(f"{folder}: {len(measured.trials)} recorded casts, nothing to execute")
        return
    rig = build_rig(config)
    with bar("feasible actions") as progress:
        actions, report = filtered_grid(config, progress, grid="collected")
    console.print(f"{report.feasible} of {report.candidates} actions are feasible")
    size = config.scale.collect
    chosen = choose_casts(actions, size.casts, size.repeats, config.seed)
    with bar(f"collect {rig.cable.name}") as progress:
        collected = collect_casts(rig, chosen, folder, build_limits(config), progress)
    for number, reason in collected.failed.items():
        console.print(f"cast {number} failed: {reason}", style="yellow", markup=False)
    console.print(
        f"{folder}: {collected.added} casts added to {collected.stood}, "
        f"{len(collected.failed)} failed"
    )


if __name__ == "__main__":
    stage(collect)()
