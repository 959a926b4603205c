"""Simulate resets after casts and keep how they scatter the start: the virtual rig draws from it.

Not part of the pipeline; rerun it for a cable whose `truth` or reset has changed.
"""

from grids import build_limits, build_reset, feasible_grid
from omegaconf import DictConfig
from stage import bar, console, stage
from virtual_rig import build_virtual_rig

from robotcast.casts.plan import plan_action
from robotcast.files import atomic_file
from robotcast.rigs.collect import choose_casts
from robotcast.rigs.virtual.arm import packaged_path, scatter_table, straight_start
from robotcast.rigs.virtual.studies import measure_resets

RESETS = 20


def measure_reset(config: DictConfig) -> None:
    rig = build_virtual_rig(config, scatter=straight_start())
    limits = build_limits(config)
    chosen = choose_casts(feasible_grid(config, grid="collected"), RESETS, 0, config.seed)
    casts = [plan_action(action, r0_m=rig.r0_m, limits=limits) for _, action in chosen]
    with bar(f"resets of {rig.cable.name}") as progress:
        scatter = measure_resets(rig, casts, build_reset(config), progress)
    path = packaged_path(rig.cable.name)
    with atomic_file(path) as temporary:
        scatter_table(scatter).write_csv(temporary, float_precision=6)
    spread = scatter.headings_rad.std(axis=0, ddof=1) * 1e3
    shown = ", ".join(f"{value:.1f}" for value in spread)
    console.print(f"{path.name}: headings scatter by {shown} mrad from the hand to the free end")


if __name__ == "__main__":
    stage(measure_reset)()
