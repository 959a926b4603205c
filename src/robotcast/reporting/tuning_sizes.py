"""What more casts to tune to are worth: errors on the same held-out casts (paper, Real2Sim)."""

from collections.abc import Sequence

import numpy as np
import polars as pl

from robotcast.reporting.names import simulator_name
from robotcast.reporting.results import Tuning

SIZE_HEAD = (
    "Simulator",
    "Casts tuned to",
    "Simulated casts",
    "Waypoint error on them",
    "Held-out waypoint error",
    "Held-out final error",
    "Change",
    "from",
    "to",
)
_DRAWS, _SEED = 4000, 0


def size_rows(tunings: Sequence[Tuning]) -> list[tuple[object, ...]]:
    """Return `SIZE_HEAD` for every tuning, by simulator and number of casts.

    The change of the held-out waypoint error is against the fewest casts that this simulator was
    tuned to, cast by cast, with its 95 % bootstrap interval over casts (Efron 1979).

    Raises
    ------
    ValueError
        When tunings of one simulator were not judged on the same casts.
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
            rows.append(
                (
                    simulator_name(simulator),
                    _casts(tuning),
                    tuning.facts["simulated_casts"],
                    tuning.error("tune", "waypoint_percent"),
                    tuning.error("test", "waypoint_percent"),
                    tuning.error("test", "final_percent"),
                    *(("–",) * 3 if tuning is of[0] else _mean_and_interval(change)),
                )
            )
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
