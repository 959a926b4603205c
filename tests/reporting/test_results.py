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


def test_lost_casts_are_no_errors_and_a_target_that_lost_all_is_still_known(
    tmp_path, data_folder
) -> None:
    source = data_folder / "evaluation" / "cable1" / "nn-mixed" / "evaluation.csv"
    table, (target, repeat) = pl.read_csv(source), (pl.col("target"), pl.col("repeat"))
    lost = (target == 0) | ((target == 3) & (repeat == 1))
    folder = tmp_path / "evaluation" / "cable1" / "nn-mixed"
    folder.mkdir(parents=True)
    table.with_columns(
        pl.when(lost).then(None).otherwise(pl.col(name)).alias(name)
        for name in ("x", "y", "error_m", "error_percent")
    ).write_csv(folder / "evaluation.csv")
    evaluation = read_results(tmp_path).evaluations[0]
    assert (evaluation.lost, len(evaluation.errors_percent), evaluation.targets) == (6, 74, 16)
    assert evaluation.unseen_m == (tuple(table.select("target_x", "target_y").row(0)),)
    legend = targets_figure([evaluation], [None]).legends[0]
    assert "all casts lost in tracking" in {text.get_text() for text in legend.get_texts()}


def test_scatter_of_repeats_is_smaller_than_the_error(data_folder) -> None:
    evaluation = read_results(data_folder).evaluation("cable1", "nn", "real")
    assert evaluation is not None and evaluation.scatter_percent is not None
    assert 0 < evaluation.scatter_percent < float(evaluation.errors_percent.max())
