from dataclasses import replace

import numpy as np
import pytest

from robotcast.reporting.results import Results, read_results
from robotcast.reporting.table import Table
from robotcast.reporting.tables.cables import cables_table
from robotcast.reporting.tables.parts import parts_table
from robotcast.reporting.tables.policies import policies_table
from robotcast.reporting.tables.tuning import tuning_table


@pytest.fixture(scope="module")
def results(data_folder) -> Results:
    return read_results(data_folder)


def row_of(table: Table, *labels: str) -> dict[str, str]:
    names = [f"{g.title}: {c}" for g in table.groups for c in g.columns]
    row = next(r for r in table.rows if r.labels == labels)
    return dict(zip(names, (c.text for c in row.cells), strict=True))


def test_tuning_shows_the_papers_simulators_run_or_not(results) -> None:
    table = tuning_table(results)
    assert [r.labels[0] for r in table.rows] == [
        "PyBullet, DE",
        "Hybrid, DE",
        "Segmented, DE",
        "Noise floor (repeats)",
    ]
    assert row_of(table, "PyBullet, DE")["virtual rig, Cable 1: Wayp."] == "–"
    segmented = row_of(table, "Segmented, DE")
    assert segmented["virtual rig, Cable 1: Last"] == "3.1%"
    assert segmented["paper’s robot, Cable 1: Wayp."] == "9%"


def test_the_noise_floor_stands_under_the_errors(results) -> None:
    floor = row_of(tuning_table(results), "Noise floor (repeats)")
    measured = results.cables[0].floor
    assert measured is not None and measured.final_percent is not None
    assert floor["virtual rig, Cable 1: Last"] == f"{measured.final_percent:.1f}%"
    assert floor["paper’s robot, Cable 1: Last"] == "–"


def test_policies_have_the_papers_five_rows_with_its_values(results) -> None:
    table = policies_table(results)
    assert [r.labels[1] for r in table.rows] == [
        "Cast and Pull",
        "Gaussian Proc.",
        "π_RD",
        "π_SD",
        "π_R2S2R",
    ]
    mixed = row_of(table, "Cable 1", "π_R2S2R", "D_real ∪ D_sim")
    assert mixed["paper’s robot, Cable 1: Max"] == "105%"
    evaluation = results.evaluation("cable1", "nn", "mixed")
    assert evaluation is not None
    assert mixed["virtual rig: Median"] == f"{np.median(evaluation.errors_percent):.1f}%"
    assert float(mixed["Median: from"].rstrip("%")) <= np.median(evaluation.errors_percent)
    assert mixed["Repeats: Scatter"] == f"{evaluation.scatter_percent:.1f}%"
    none = row_of(table, "Cable 1", "Cast and Pull", "N/A")
    assert none["virtual rig: Median"] == none["Repeats: Scatter"] == "–"


def test_the_lowest_of_each_column_is_bold(results) -> None:
    table = policies_table(results)
    medians = [r.cells[0] for r in table.rows]
    best = min((c for c in medians if c.value is not None), key=lambda c: c.value or 0)
    assert [c for c in medians if c.best] == [best]
    assert [r.cells[-1].best for r in table.rows] == [False, False, True, False, False]


def test_other_cables_show_only_the_policies_that_were_run(results) -> None:
    mixed = next(e for e in results.evaluations if e.cable == "cable2")
    both = replace(results, evaluations=(*results.evaluations, replace(mixed, policy="residual")))
    assert [r.labels for r in policies_table(both).rows if r.labels[0] == "Cable 2"] == [
        ("Cable 2", "π_R2S2R", "D_real ∪ D_sim"),
        ("Cable 2", "Residual", "D_real ∪ D_sim"),
    ]


def test_cables_has_one_row_a_cable(results) -> None:
    table = cables_table(results)
    assert [r.labels[0] for r in table.rows] == ["Cable 1", "Cable 2", "Cable 3"]
    assert row_of(table, "Cable 2")["paper’s robot: Median"] == "12%"


def test_every_caption_names_the_rig_and_the_paper(results) -> None:
    for table in (tuning_table(results), policies_table(results), cables_table(results)):
        assert "virtual rig" in table.caption
        assert "paper’s robot" in table.caption


def test_captions_count_targets_and_repeats(results) -> None:
    assert "16 targets × 5 casts each" in cables_table(results).caption


def test_parts_tell_repeatability_from_the_models_share(results) -> None:
    table = parts_table(results)
    row = {
        name: float(text.rstrip("%"))
        for name, text in row_of(table, "Cable 1", "π_R2S2R", "D_real ∪ D_sim").items()
    }
    assert row["Median: from"] <= row["Median: Median"] <= row["Median: to"]
    repeats, model = row["Root mean square: Repeatability"], row["Root mean square: Model"]
    share = 100 * repeats**2 / (repeats**2 + model**2)
    assert row["Share: Aleatoric"] == pytest.approx(share, abs=2)
    assert row["Share: Aleatoric"] + row["Share: Epistemic"] == pytest.approx(100, abs=0.11)
    far = row_of(table, "Cable 1", "π_RD", "D_real")["Root mean square: Model"]
    assert float(far.rstrip("%")) > model
    assert row["Model’s spread: Expected"] == pytest.approx(
        100 * np.hypot(0.03, 0.02) / results.cable("cable1").measured.cable.length_m, abs=0.1
    )
    casts = results.evaluation("cable1", "nn", "mixed").casts
    away_x, away_y = casts["x"] - casts["predicted_x"], casts["y"] - casts["predicted_y"]
    inside = (away_x / 0.03) ** 2 + (away_y / 0.02) ** 2 < 5.991
    assert row["Model’s spread: Covered"] == pytest.approx(100 * inside.mean(), abs=0.1)
