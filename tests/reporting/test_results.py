import polars as pl
import pytest

from robotcast.reporting.figures import targets_figure
from robotcast.reporting.results import read_results


def test_everything_under_the_data_folder_is_read(data_folder) -> None:
    results = read_results(data_folder)
    assert [c.name for c in results.cables] == ["cable1", "cable2", "cable3"]
    assert len(results.tunings) == 3
    assert len(results.evaluations) == len(results.policies) == 5
    assert results.rigs == ("virtual",)


def test_an_empty_folder_is_refused(tmp_path) -> None:
    with pytest.raises(ValueError, match="holds no results to report"):
        read_results(tmp_path)


def test_a_lost_cast_counts_as_lost_and_not_as_an_error(tmp_path, data_folder) -> None:
    source = data_folder / "evaluation" / "cable1" / "nn-mixed" / "evaluation.csv"
    lost = pl.read_csv(source).with_row_index()
    for column in ("x", "y", "error_m", "error_percent"):
        lost = lost.with_columns(
            pl.when(pl.col("index") == 3).then(None).otherwise(pl.col(column)).alias(column)
        )
    folder = tmp_path / "evaluation" / "cable1" / "nn-mixed"
    folder.mkdir(parents=True)
    lost.drop("index").write_csv(folder / "evaluation.csv")
    evaluation = read_results(tmp_path).evaluations[0]
    assert evaluation.lost == 1
    assert len(evaluation.errors_percent) == 79


def test_a_target_whose_casts_are_all_lost_is_still_known(tmp_path, data_folder) -> None:
    source = data_folder / "evaluation" / "cable1" / "nn-mixed" / "evaluation.csv"
    table = pl.read_csv(source)
    hit = pl.col("target") == table["target"][0]
    measured = [
        pl.when(hit).then(None).otherwise(pl.col(name)).alias(name)
        for name in ("x", "y", "error_m", "error_percent")
    ]
    folder = tmp_path / "evaluation" / "cable1" / "nn-mixed"
    folder.mkdir(parents=True)
    table.with_columns(measured).write_csv(folder / "evaluation.csv")
    evaluation = read_results(tmp_path).evaluations[0]
    assert evaluation.unseen_m == (tuple(table.select("target_x", "target_y").row(0)),)
    assert evaluation.targets == 16
    legend = targets_figure([evaluation], [None]).legends[0]
    assert "all casts lost in tracking" in {text.get_text() for text in legend.get_texts()}


def test_scatter_of_repeats_is_smaller_than_the_error(data_folder) -> None:
    evaluation = read_results(data_folder).evaluation("cable1", "nn", "real")
    assert evaluation is not None and evaluation.scatter_percent is not None
    assert 0 < evaluation.scatter_percent < float(evaluation.errors_percent.max())
