"""Put what more casts to tune to are worth into one table."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import polars as pl
from omegaconf import DictConfig

from robotcast.files import write_text
from robotcast.reporting.names import cable_name, name_of, rig_names
from robotcast.reporting.page import markdown
from robotcast.reporting.results import Tuning, read_tuning
from robotcast.stage import output_folder, stage, tell

SIZE_HEAD = (
    *("Simulator", "Casts tuned to", "Simulated casts", "Waypoint error on them"),
    *("Held-out waypoint error", "Held-out final error", "Change", "from", "to"),
)
_DRAWS, _SEED = 4000, 0
TEXT = """# How many casts to tune to?

Simulators tuned by differential evolution to casts of {cable}, {rig}, and judged on the same
held-out ones. The fewer casts are among the more; both searches have as many generations, so that
one on three times the casts simulates three times as many. Change: of the held-out waypoint error
against the fewest casts, cast by cast, with its 95 % bootstrap interval over casts. Errors in % of
cable length. The paper saw a negligible difference between 20 and 60 casts. Made by
`make tune-size`.

"""


def size_rows(tunings: Sequence[Tuning]) -> list[tuple[object, ...]]:
    """Return `SIZE_HEAD` for every tuning, by simulator and number of casts.

    The change of the held-out waypoint error is against the fewest casts that this simulator was
    tuned to, cast by cast, with its 95 % bootstrap interval over casts (Efron 1979). ValueError
    when tunings of one simulator were not judged on the same casts.
    """
    rows: list[tuple[object, ...]] = []
    for simulator in sorted({t.simulator for t in tunings}):
        of = sorted((t for t in tunings if t.simulator == simulator), key=_casts)
        fewest = _cast_errors_percent(of[0])
        for tuning in of:
            errors = _cast_errors_percent(tuning)
            if errors["trial"].to_list() != fewest["trial"].to_list():
                raise ValueError(
                    f"{simulator} tuned to {_casts(tuning)} and to {_casts(of[0])} casts was not "
                    "judged on the same ones: tune both anew"
                )
            change = (errors["percent"] - fewest["percent"]).to_numpy()
            facts = (name_of(simulator), _casts(tuning), tuning.facts["simulated_casts"])
            on_them, held_out = (tuning.error(on, "waypoint_percent") for on in ("tune", "test"))
            final = tuning.error("test", "final_percent")
            against = ("–",) * 3 if tuning is of[0] else _mean_and_interval(change)
            rows.append((*facts, on_them, held_out, final, *against))
    return rows


def _casts(tuning: Tuning) -> int:
    return tuning.facts["errors"]["tune"]["n_casts"]


def _cast_errors_percent(tuning: Tuning) -> pl.DataFrame:
    """Return every held-out cast's average waypoint error; a diverged run counts one length."""
    if tuning.predictions is None:
        raise ValueError(f"{tuning.simulator}: predictions.parquet is missing, tune anew")
    away = (pl.col("x") - pl.col("x_predicted")) ** 2 + (pl.col("y") - pl.col("y_predicted")) ** 2
    length_m = tuning.facts["cable"]["length_m"]
    return (
        tuning.predictions.filter(pl.col("split") == "test")
        .group_by("trial")
        .agg(percent=(100 * away.sqrt().mean() / length_m).fill_nan(100.0))
        .sort("trial")
    )


def _mean_and_interval(change: np.ndarray) -> tuple[float, float, float]:
    random = np.random.default_rng(_SEED)
    means = change[random.integers(len(change), size=(_DRAWS, len(change)))].mean(axis=1)
    low, high = np.percentile(means, [2.5, 97.5])
    return float(change.mean()), float(low), float(high)


def table(config: DictConfig) -> None:
    settings = config.study
    tunings = [read_tuning(p) for p in sorted(Path(settings.folder).glob("*/tuned.yaml"))]
    if not tunings:
        raise ValueError(f"{settings.folder} holds no tuned simulator: run the study's tunings")
    cable, rigs = tunings[0].cable, tuple(sorted({t.facts["rig"] for t in tunings}))
    text = TEXT.format(cable=cable_name(cable), rig=rig_names(rigs))
    rows = size_rows(tunings)
    folder = output_folder(settings.reports)
    write_text(folder / "README.md", text + markdown(SIZE_HEAD, rows))
    tell(f"{folder}: {len(rows)} tunings")


if __name__ == "__main__":
    stage(table)()
