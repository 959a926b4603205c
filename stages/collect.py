"""Collect casts into the session folder: those of the chosen actions that it does not hold.

python stages/collect.py [collect.actions=FILE]   # in place of actions drawn from the grid
"""

from pathlib import Path

from omegaconf import DictConfig

from robotcast.build import build, build_rig
from robotcast.rigs.collect import collect_casts
from robotcast.rigs.virtual.hiding import set_aside
from robotcast.sessions import adopt_recorded_set
from robotcast.stage import bar, named_session, output_folder, stage, tell, warn
from robotcast.workflow.collecting import chosen_casts
from robotcast.workflow.commissioning import show_dry_run


def collect(config: DictConfig) -> None:
    folder = output_folder(str(named_session(config)))
    if config.rig.name == "recorded":
        if config.collect.actions is not None:
            raise ValueError("rig=recorded cannot cast the actions of collect.actions")
        measured = adopt_recorded_set(config.rig.path and Path(config.rig.path), folder)
        return tell(f"{folder}: {len(measured.trials)} recorded casts, nothing to execute")
    rig, limits = build_rig(config), build(config.casts.limits)
    chosen = chosen_casts(config, folder)
    if config.rig.get("dry_run"):
        return show_dry_run(rig, limits, [action for _, action in chosen], folder)
    if config.hidden is not None and (aside := set_aside(folder, rig)):
        warn(f"{folder}: something else was hidden there; those casts lie in {aside} now")
    with bar(f"collect {rig.cable.name}") as progress:
        done = collect_casts(rig, chosen, folder, limits, progress)
    for number, reason in done.failed.items():
        warn(f"cast {number} failed: {reason}")
    tell(f"{folder}: {done.added} casts added to {done.stood}, {len(done.failed)} failed")


if __name__ == "__main__":
    stage(collect)()
