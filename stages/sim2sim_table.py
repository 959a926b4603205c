"""Put what every optimizer came to on made-up models into one table, beside the paper's ranges."""

from pathlib import Path

from omegaconf import DictConfig
from stage import console, output_folder, stage

from robotcast.files import write_text
from robotcast.sim2sim.outcome import read_outcomes
from robotcast.sim2sim.tables import csv_text, markdown, rows

TEXT = """# Sim2Sim: known parameters, tuned from random starts

A model with arbitrary parameters simulates casts; the same simulator is then tuned to them. The
parameter error of a tuning is the largest over the parameters that these casts tell: those that
misses of {shown:g} % of cable length would leave within {told:g} % of their value. The median and
the worst of the tunings stand side by side, then how many came within 1 %. The waypoint error is on
casts that were not tuned to, in % of cable length, the median again. A search that is done ends
below its budget (`conf/sim2sim/full.yaml`). The paper's values are of its own
implementations in another engine; its range of Bayesian optimization is over three acquisitions.

"""


def sim2sim_table(config: DictConfig) -> None:
    settings = config.sim2sim
    table = rows(read_outcomes(Path(settings.folder)), settings.told_percent)
    folder = output_folder(settings.reports)
    text = TEXT.format(shown=settings.shown_percent, told=settings.told_percent)
    write_text(folder / "README.md", text + markdown(table))
    write_text(folder / "sim2sim.csv", csv_text(table))
    console.print(f"{folder}: {len(table) - 1} rows")


if __name__ == "__main__":
    stage(sim2sim_table)()
