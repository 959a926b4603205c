"""The table of what more casts to tune to are worth."""

from collections.abc import Callable

import numpy as np
import polars as pl
import pytest

from robotcast.reporting.results import Tuning
from robotcast.reporting.tuning_sizes import SIZE_HEAD, size_rows

LENGTH_M = 0.5


def tuning(casts: int, miss_m: Callable[[int], float], trials: range = range(30)) -> Tuning:
    """Return a model that misses every waypoint of trial k by miss_m(k)."""
    rows = [(k, 0.1 * j, 0.0, 0.0, miss_m(k), 0.0) for k in trials for j in range(4)]
    columns = ["trial", "t", "x", "y", "x_predicted", "y_predicted"]
    paths = pl.DataFrame(rows, schema=columns, orient="row").with_columns(split=pl.lit("test"))
    error = {"waypoint_percent": 1.0, "final_percent": 2.0, "n_casts": casts}
    facts = {
        "cable": {"length_m": LENGTH_M},
        "simulated_casts": 6100 * casts,
        "errors": {"tune": error, "test": error},
    }
    return Tuning("cable1", "segmented", "de", facts, None, paths)


def test_the_change_is_taken_cast_by_cast() -> None:
    few, many = tuning(20, lambda k: 0.01 + 0.01 * k), tuning(60, lambda k: 0.005 + 0.01 * k)
    first, second = (dict(zip(SIZE_HEAD, row, strict=True)) for row in size_rows([many, few]))
    assert (first["Casts tuned to"], second["Casts tuned to"]) == (20, 60)
    assert first["Change"] == "–"
    # every cast is nearer by 5 mm, 1 % of the length, however far the casts differ
    assert [second[name] for name in ("Change", "from", "to")] == pytest.approx([-1.0] * 3)


def test_a_run_that_diverged_counts_one_cable_length() -> None:
    few = tuning(20, lambda _k: 0.0)
    many = tuning(60, lambda k: np.nan if k == 3 else 0.0)
    assert size_rows([few, many])[1][6] == pytest.approx(100 / 30)


def test_tunings_judged_on_other_casts_are_not_compared() -> None:
    few, many = tuning(20, lambda _k: 0.0), tuning(60, lambda _k: 0.0, range(1, 31))
    with pytest.raises(ValueError, match="tuned to 60 and to 20 casts was not judged on the same"):
        size_rows([few, many])
