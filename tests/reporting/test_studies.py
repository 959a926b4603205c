from dataclasses import replace
from pathlib import Path

import polars as pl
import pytest

from robotcast.reporting.figures.style import style, svg
from robotcast.reporting.results import Evaluation, read_evaluation
from robotcast.reporting.studies import (
    HEAD,
    Point,
    change_rows,
    ladder_figure,
    markdown,
    real_casts_figure,
)


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
    told = dict(zip(HEAD, Point("mixed", 20, evaluations["mixed"]).numbers, strict=True))
    assert told["from"] <= told["median"] <= told["to"]
    assert told["q1"] <= told["median"] <= told["q3"]
    assert told["casts"] == 80


def test_both_figures_are_the_same_bytes_again(evaluations) -> None:
    models = {"base": 6.0, "diagnosed": 3.0}
    for draw in (
        lambda: real_casts_figure(points(evaluations, [20, 60, 445])),
        lambda: ladder_figure(models, points(evaluations, [0, 1])),
    ):
        drawn = []
        for _ in range(2):
            with style():
                drawn.append(svg(draw()))
        assert drawn[0] == drawn[1]


def test_the_markdown_table_has_one_decimal_and_no_minus_before_zero() -> None:
    table = markdown(("a", "b", "c"), [(1, 2.345, -0.04)])
    assert table == "| a | b | c |\n| --- | --- | --- |\n| 1 | 2.3 | 0.0 |\n"


def test_the_change_between_two_places_is_told_group_by_group(evaluations) -> None:
    better = Point("real", 1, evaluations["mixed"])
    rows = change_rows([Point("real", 0, evaluations["real"]), better, *points(evaluations, [7])])
    change, low, high = evaluations["mixed"].change_from(evaluations["real"])
    medians = [evaluations[name].median_percent for name in ("real", "mixed")]
    assert change == pytest.approx(medians[1] / medians[0] - 1)
    assert low <= change <= high
    assert len(rows) == 1


def test_policies_tested_at_other_targets_are_not_compared(evaluations) -> None:
    moved = evaluations["real"].casts.with_columns(pl.col("target_x") + 0.01)
    with pytest.raises(ValueError, match="no target at which casts of both"):
        evaluations["mixed"].change_from(replace(evaluations["real"], casts=moved))
