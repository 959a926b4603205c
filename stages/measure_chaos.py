"""Say which of a sample of collected actions are chaotic, and how well the rig repeats each.

Not part of the pipeline; its tables stand in reports/chaos.
"""

import polars as pl
from omegaconf import DictConfig

from robotcast.build import action_space, build_rig
from robotcast.casts.action import ACTION_COLUMNS
from robotcast.casts.plan import plan_action
from robotcast.files import write_text
from robotcast.rigs.collect import choose_casts
from robotcast.rigs.envelope import feasible_actions
from robotcast.rigs.virtual.rig import CHAOTIC, sensitivities
from robotcast.stage import bar, output_folder, stage, tell


def measure_chaos(config: DictConfig) -> None:
    rig, space = build_rig(config), action_space(config, "collected")
    chosen = choose_casts(feasible_actions(*space)[0], 40, 0, config.seed)
    casts = [plan_action(action, r0_m=rig.r0_m, limits=space[2]) for _, action in chosen]
    with bar(f"sensitivities of {rig.cable.name}") as progress:
        found = sensitivities(rig, casts, 4, progress)
    keys = ("action", *ACTION_COLUMNS, "amplification", "scatter_percent", "chaotic")
    rows = [
        (n, *a.as_array(), larger, 100 * scatter_m / rig.cable.length_m, larger >= CHAOTIC)
        for (n, a), (larger, scatter_m) in zip(chosen, found, strict=True)
    ]
    table = pl.DataFrame(rows, keys, orient="row").sort("amplification")
    path = output_folder(f"{config.paths.reports}/chaos") / f"{rig.cable.name}.csv"
    write_text(path, table.write_csv(float_precision=4))
    scatter = [table["scatter_percent"].quantile(share, "linear") for share in (0.5, 0.25, 0.9)]
    text = "repeats scatter by {:.2f} % of cable length in the median (quarter {:.2f} %, 90 % of "
    said = (text + "casts {:.2f} %)").format(*scatter)
    tell(f"{path}: {said}; {table['chaotic'].sum()} of {len(table)} casts are chaotic")


if __name__ == "__main__":
    stage(measure_chaos)()
