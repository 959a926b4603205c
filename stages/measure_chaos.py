"""Say which of a sample of collected actions are chaotic, and how well the rig repeats each.

Not part of the pipeline; its tables stand in reports/chaos.
"""

import numpy as np
import polars as pl
from grids import build_limits, feasible_grid
from omegaconf import DictConfig
from stage import bar, console, output_folder, stage
from virtual_rig import build_virtual_rig

from robotcast.casts.action import ACTION_COLUMNS
from robotcast.casts.plan import plan_action
from robotcast.files import atomic_file
from robotcast.rigs.collect import choose_casts
from robotcast.rigs.virtual.studies import sensitivities

ACTIONS, REPEATS = 40, 4


def measure_chaos(config: DictConfig) -> None:
    rig, limits = build_virtual_rig(config), build_limits(config)
    chosen = choose_casts(feasible_grid(config, grid="collected"), ACTIONS, 0, config.seed)
    casts = [plan_action(action, r0_m=rig.r0_m, limits=limits) for _, action in chosen]
    with bar(f"sensitivities of {rig.cable.name}") as progress:
        found = sensitivities(rig, casts, REPEATS, progress)
    percent = 100 * np.array([one.scatter_m for one in found]) / rig.cable.length_m
    table = pl.DataFrame(
        {
            "action": [number for number, _ in chosen],
            **dict(zip(ACTION_COLUMNS, np.array([a.as_array() for _, a in chosen]).T, strict=True)),
            "amplification": [one.amplification for one in found],
            "scatter_percent": percent,
            "chaotic": [one.chaotic for one in found],
        }
    )
    path = output_folder(f"{config.paths.reports}/chaos") / f"{rig.cable.name}.csv"
    with atomic_file(path) as temporary:
        table.sort("amplification").write_csv(temporary, float_precision=4)
    quarter, median, most = np.percentile(percent, [25, 50, 90])
    console.print(
        f"{path}: repeats scatter by {median:.2f} % of cable length in the median "
        f"(quarter {quarter:.2f} %, 90 % of casts {most:.2f} %); "
        f"{table['chaotic'].sum()} of {len(table)} casts are chaotic"
    )


if __name__ == "__main__":
    stage(measure_chaos)()
