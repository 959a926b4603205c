"""Put what every optimizer came to on invented models into one table, beside the paper's ranges."""

from pathlib import Path

import numpy as np
import polars as pl
from omegaconf import DictConfig

from robotcast.files import write_text
from robotcast.reporting.names import name_of, thousands
from robotcast.reporting.page import markdown
from robotcast.reporting.tables import MISSING, SIM2SIM, SIM2SIM_CASTS
from robotcast.stage import output_folder, stage, tell

NEAR_PERCENT = 1.0  # the paper's bar: a tuning is near when its parameters are within this
HEAD = (
    "Simulator", "Parameters", "Casts", "Optimizer", "Tunings", "Parameters told",
    "Parameter error [%]", "Worst [%]", "Within 1 %", "Waypoint error [%]",
    "Simulated casts, at most", "Paper [%]", "Commit",
)  # fmt: skip
TEXT = """# Sim2Sim: known parameters, tuned from random starts

A model with arbitrary parameters simulates casts; the same simulator is then tuned to them. Of the
segmented model the paper tunes four parameters and the others are held; ours are seven, the cable's
mass is held. The parameter error of a tuning is the largest over the parameters that these casts
tell: those that misses of {shown:g} % of cable length would leave within {told:g} % of their value.
The median and the worst of the tunings stand side by side, then how many came within 1 %. The
waypoint error is on casts that were not tuned to, in % of cable length, the median again. A search
that is done ends below its budget (`studies/sim2sim/full.yaml`). The paper's values are of its own
implementations in another engine; its range of Bayesian optimization is over three acquisitions.
What Bayesian optimization was before: of the error alone, it missed our seven, by five casts, by a
median of 71 to 499 % over three acquisitions, with waypoint errors of 1.05 to 2.62 % and 1 500
simulated casts (172291b); of the residuals, in regions that ended early, by 0.642 %, worst 47.6 %,
with 0.0242 % and 3 000 casts (67996a2), and the paper's four by 0.00424 % (bb76b3f).

A row is of the code at its commit and comes again by, for one,

    python -m studies.sim2sim.tune scale=paper simulator=segmented optimizer=bo \\
        sim2sim.parameters=paper sim2sim.casts=5
    python -m studies.sim2sim.table

"""


def read_outcomes(folder: Path) -> pl.DataFrame:
    """Read the rows of all simulators, optimizers and numbers of casts in a folder."""
    paths = sorted(folder.glob("[!.]*.csv"))
    if not paths:
        raise FileNotFoundError(f"{folder} holds no outcomes: run studies.sim2sim.tune first")
    texts = {"unit": pl.String, "commit": pl.String}  # "1" is a unit
    return pl.concat(pl.read_csv(path, schema_overrides=texts) for path in paths).with_columns(
        error_percent=100 * ((pl.col("found") - pl.col("true")) / pl.col("true")).abs()
    )


def rows(outcomes: pl.DataFrame, told_percent: float) -> list[tuple[str, ...]]:
    """Return `HEAD` for every simulator, its parameters, number of casts and optimizer.

    A parameter counts where the casts tell it within `told_percent` of its value.
    """
    found = []
    cells = outcomes.group_by("simulator", "parameters", "casts", "optimizer")
    for (simulator, parameters, casts, optimizer), of in sorted(cells, key=lambda cell: cell[0]):
        tunings = of.unique(["model", "start"])
        told = of.filter(pl.col("told_within_percent") <= told_percent)
        worst = told.group_by("model", "start").max()["error_percent"].to_numpy()
        found.append(
            (
                name_of(simulator),
                f"{'paper’s' if parameters == 'paper' else 'ours'}, {of['parameter'].n_unique()}",
                str(casts),
                name_of(optimizer),
                str(len(tunings)),
                f"{len(told)} of {len(of)}",
                _number(np.median(worst) if len(worst) else np.nan),
                _number(worst.max(initial=-np.inf) if len(worst) else np.nan),
                f"{(worst <= NEAR_PERCENT).sum()} of {len(worst)}",
                _number(np.median(tunings["test_percent"])),
                thousands(tunings["simulated_casts"].to_numpy().max()),
                _paper(simulator, parameters, optimizer, casts),
                ", ".join(sorted(of["commit"].unique())),
            )
        )
    return found


def _number(value: float) -> str:
    return MISSING if np.isnan(value) else f"{value:.3g}"


def _paper(simulator: str, parameters: str, optimizer: str, casts: int) -> str:
    """Return the paper's range, which it has of its own parameters, of BO by 5 casts alone."""
    low, high = SIM2SIM.get(simulator, {}).get(optimizer, (None, None))
    if high is None or parameters != "paper" or (optimizer == "bo" and casts != SIM2SIM_CASTS):
        return MISSING
    return f"< {high:g}" if low is None else f"{low:g} to {high:g}"


def csv_text(table: list[tuple[str, ...]]) -> str:
    """Write the table as CSV, empty where nothing is known."""
    shown = pl.DataFrame(table, dict.fromkeys(HEAD, pl.String), orient="row")
    return shown.select(pl.all().str.replace_all("\u202f", "").replace(MISSING, None)).write_csv()


def table(config: DictConfig) -> None:
    settings = config.sim2sim
    found = rows(read_outcomes(Path(settings.folder)), settings.told_percent)
    folder = output_folder(settings.reports)
    text = TEXT.format(shown=settings.shown_percent, told=settings.told_percent)
    write_text(folder / "README.md", text + markdown(HEAD, found))
    write_text(folder / "sim2sim.csv", csv_text(found))
    tell(f"{folder}: {len(found)} rows")


if __name__ == "__main__":
    stage(table)()
