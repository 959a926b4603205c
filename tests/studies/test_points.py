from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from robotcast.reporting.results import Evaluation, Tuning, read_evaluation
from robotcast.reporting.style import style, svg
from studies.better_model.table import change_rows, ladder_figure
from studies.points import HEAD, Point, median_change
from studies.points import change as between
from studies.real_casts.table import errors_figure
from studies.tune_size.table import SIZE_HEAD, size_rows

LENGTH_M = 0.5


@pytest.fixture(scope="module")
def evaluations(data_folder: Path) -> dict[str, Evaluation]:
    folder = data_folder / "evaluation" / "cable1"
    return {
        dataset: read_evaluation(folder / f"nn-{dataset}" / "evaluation.csv")
        for dataset in ("real", "mixed")
    }


def points(evaluations: dict[str, Evaluation], places: list[float]) -> list[Point]:
    return [Point(dataset, place, e) for dataset, e in evaluations.items() for place in places]


def test_a_point_tells_the_median_between_its_interval_and_the_quartiles(evaluations) -> None:
    numbers = dict(zip(HEAD, Point("mixed", 20, evaluations["mixed"]).numbers, strict=True))
    assert numbers["from"] <= numbers["median"] <= numbers["to"]
    assert numbers["q1"] <= numbers["median"] <= numbers["q3"]
    assert numbers["casts"] == 80


def test_both_figures_are_the_same_bytes_again(evaluations) -> None:
    def drawn() -> list[str]:
        ladder = ladder_figure({"base": 6.0, "diagnosed": 3.0}, points(evaluations, [0, 1]))
        with style():
            return [svg(errors_figure(points(evaluations, [20, 60, 445]))), svg(ladder)]

    assert drawn() == drawn()


def test_the_change_between_two_places_is_given_group_by_group(evaluations) -> None:
    better = Point("real", 1, evaluations["mixed"])
    rows = change_rows([Point("real", 0, evaluations["real"]), better, *points(evaluations, [7])])
    change, low, high = between(evaluations["real"], evaluations["mixed"])
    medians = [evaluations[name].median_percent for name in ("real", "mixed")]
    assert change == pytest.approx(medians[1] / medians[0] - 1)
    assert low <= change <= high
    assert len(rows) == 1


def test_policies_tested_at_other_targets_are_not_compared(evaluations) -> None:
    moved = evaluations["real"].casts.with_columns(pl.col("target_x") + 0.01)
    with pytest.raises(ValueError, match="no target at which casts of both"):
        between(replace(evaluations["real"], casts=moved), evaluations["mixed"])


def tuning(casts: int, miss_m: Callable[[int], float], trials: range = range(30)) -> Tuning:
    """Return a model that misses every waypoint of trial k by miss_m(k)."""
    rows = [(k, 0.1 * j, 0.0, 0.0, miss_m(k), 0.0) for k in trials for j in range(4)]
    columns = ["trial", "t", "x", "y", "x_predicted", "y_predicted"]
    paths = pl.DataFrame(rows, schema=columns, orient="row").with_columns(split=pl.lit("test"))
    error = {"waypoint_percent": 1.0, "final_percent": 2.0, "n_casts": casts}
    facts = {"cable": {"length_m": LENGTH_M}, "simulated_casts": 6100 * casts}
    facts["errors"] = {"tune": error, "test": error}
    return Tuning("cable1", "segmented", "de", facts, None, paths)


def test_the_change_is_taken_cast_by_cast() -> None:
    few, many = tuning(20, lambda k: 0.01 + 0.01 * k), tuning(60, lambda k: 0.005 + 0.01 * k)
    first, second = (dict(zip(SIZE_HEAD, row, strict=True)) for row in size_rows([many, few]))
    assert (first["Casts tuned to"], second["Casts tuned to"]) == (20, 60)
    assert first["Change"] == "–"
    # every cast is nearer by 5 mm, 1 % of the length, however far the casts differ
    assert [second[name] for name in ("Change", "from", "to")] == pytest.approx([-1.0] * 3)


def test_a_diverged_run_counts_one_cable_length_and_other_casts_are_not_compared() -> None:
    few, many = tuning(20, lambda k: 0.0), tuning(60, lambda k: np.nan if k == 3 else 0.0)
    assert size_rows([few, many])[1][6] == pytest.approx(100 / 30)
    others = tuning(60, lambda k: 0.0, range(1, 31))
    with pytest.raises(ValueError, match="tuned to 60 and to 20 casts was not judged on the same"):
        size_rows([few, others])


def hard_and_easy(targets: int, seed: int = 3) -> list[np.ndarray]:
    random = np.random.default_rng(seed)
    return [np.abs(random.normal(hard, 0.02 * hard, 5)) for hard in random.lognormal(1, 1, targets)]


def test_a_change_that_all_targets_share_is_known_well_however_different_they_are() -> None:
    before = hard_and_easy(16)
    change, low, high = median_change(before, [0.7 * e for e in before])
    assert (change, low, high) == pytest.approx((-0.3, -0.3, -0.3))


def test_no_change_lies_in_the_interval_of_policies_that_are_alike() -> None:
    _, low, high = median_change(hard_and_easy(40, seed=1), hard_and_easy(40, seed=2))
    assert low < 0 < high


def test_more_targets_narrow_the_interval() -> None:
    def width(targets: int) -> float:
        pairs = [(hard_and_easy(targets, k), hard_and_easy(targets, k + 50)) for k in range(1, 5)]
        intervals = np.array([median_change(*pair)[1:] for pair in pairs])
        return float(np.diff(intervals).mean())

    assert width(200) < 0.5 * width(16)
