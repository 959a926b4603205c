import re
import shutil
from dataclasses import replace
from pathlib import Path

import polars as pl
import pytest

from robotcast.reporting.figures import trace_figure
from robotcast.reporting.report import RunFacts, glance, write_report
from robotcast.reporting.results import Results, read_results
from robotcast.tuning.tuned import keep_revision
from tests.tuning.some_revisions import BASE, TILT

ROOMS = ("measurements", "tuned", "simulated", "policies", "evaluation")
FACTS = RunFacts("demo", 0, (("Trained", "at most 200 epochs"),))


def written(results: Results, folder: Path) -> str:
    """Write a report and return its page."""
    write_report(results, FACTS, folder)
    return (folder / "index.html").read_text()


@pytest.fixture(scope="module")
def report(data_folder, tmp_path_factory):
    folder = tmp_path_factory.mktemp("reports")
    written(read_results(data_folder), folder)
    return folder


def test_tables_come_in_three_forms_and_figures_as_svg(report) -> None:
    tables = {p.name for p in (report / "tables").iterdir()}
    assert tables == {
        f"{name}.{suffix}"
        for name in ("tuning", "policies", "cables", "parts")
        for suffix in ("md", "tex", "csv")
    }
    figures = {p.stem for p in (report / "figures").glob("*.svg")}
    assert {"tuning_trace", "errors", "targets", "overlay_cable1_segmented-de"} <= figures


def test_the_page_needs_nothing_else_and_says_that_the_virtual_rig_is_no_robot(report) -> None:
    page = (report / "index.html").read_text()
    outside = re.findall(r'(?:src|href)="(?!data:)[^"]*"|url\((?!data:)', page)
    assert not outside
    assert "<script" not in page
    assert "The virtual rig is not a robot" in page


def test_the_same_results_give_the_same_page(data_folder, tmp_path) -> None:
    for room in ROOMS:
        shutil.copytree(data_folder / room / "cable2", tmp_path / room / "cable2")
    first, second = (written(read_results(tmp_path), tmp_path / name) for name in ("r1", "r2"))
    assert first == second


def test_a_policy_that_lost_every_cast_is_reported_without_numbers(data_folder, tmp_path) -> None:
    table = pl.read_csv(data_folder / "evaluation" / "cable1" / "nn-mixed" / "evaluation.csv")
    lost = table.with_columns(pl.lit(None).alias(c) for c in ("x", "y", "error_m", "error_percent"))
    folder = tmp_path / "data" / "evaluation" / "cable1" / "nn-mixed"
    folder.mkdir(parents=True)
    lost.write_csv(folder / "evaluation.csv")
    page = written(read_results(tmp_path / "data"), tmp_path / "reports")
    assert "lost in tracking: 80 of Cable 1, " in page


@pytest.mark.parametrize("room", ROOMS)
def test_a_report_is_written_from_whatever_is_there(data_folder, room, tmp_path) -> None:
    shutil.copytree(data_folder / room / "cable1", tmp_path / "data" / room / "cable1")
    assert "Cable 1" in written(read_results(tmp_path / "data"), tmp_path / "reports")


def test_the_ladder_of_revisions_is_drawn_from_base_to_effects(
    data_folder, report, tmp_path
) -> None:
    shutil.copytree(data_folder / "tuned" / "cable1", tmp_path / "data" / "tuned" / "cable1")
    tuned = tmp_path / "data" / "tuned" / "cable1" / "segmented-de"
    for revision in (BASE, TILT):
        keep_revision(tuned, revision)
    page = written(read_results(tmp_path / "data"), tmp_path / "reports")
    figure = (tmp_path / "reports" / "figures" / "revisions_cable1.svg").read_text()
    assert figure.index("base model") < figure.index("+ board tilt")
    assert "fall from revision to revision" in page
    assert "fall from revision to revision" not in (report / "index.html").read_text()


def test_it_names_the_policy_with_the_lowest_median(data_folder) -> None:
    results = read_results(data_folder)
    mixed = results.evaluation("cable2", "nn", "mixed")
    assert mixed is not None
    halved = mixed.casts.with_columns(mixed.casts["error_percent"] / 2)
    better = replace(mixed, policy="residual", casts=halved)
    both = replace(results, evaluations=(*results.evaluations, better))
    row = glance(both, results.cables[1])
    assert row["Cable"] == "Cable 2"
    assert row["π_R2S2R median"] == f"{mixed.median_percent:.1f}%"
    assert row["Best policy median"] == f"Residual {better.median_percent:.1f}%"
    assert row["Its repeats scatter"] == f"{better.scatter_percent:.1f}%"


def test_a_cable_without_casts_on_a_rig_has_no_best_policy(data_folder) -> None:
    results = read_results(data_folder)
    predicted = tuple(replace(e, kind="predicted") for e in results.evaluations)
    row = glance(replace(results, evaluations=predicted), results.cables[0])
    assert row["Best policy median"] == row["Its repeats scatter"] == "–"


def test_the_run_says_what_to_doubt_and_with_which_effects(
    optimizers: Results, tmp_path: Path
) -> None:
    base = next(t for t in optimizers.tunings if (t.cable, t.optimizer) == ("cable1", "de"))
    better = {"test": {**base.facts["errors"]["test"], "waypoint_percent": 0.1}}
    facts = {**base.facts, "effects": ["board_tilt"], "errors": {**base.facts["errors"], **better}}
    both = replace(optimizers, tunings=(*optimizers.tunings, replace(base, facts=facts)))
    (legend,) = trace_figure(both.tunings, {}).legends
    drawn = {text.get_text() for text in legend.get_texts()}
    methods = ("DE", "BO", "Gauss–Newton", "DE + board tilt")
    assert drawn == {f"Segmented, {method}" for method in methods}
    page = written(both, tmp_path)
    assert (tmp_path / "figures" / "overlay_cable1_segmented-de-board_tilt.svg").is_file()
    assert "<dd>Segmented, DE + board tilt: " in page
    (newton,) = re.findall("<dd>Segmented, Gauss–Newton: (.*)</dd>", page)
    assert "12 diverged" in newton
    assert "at a bound: planar_friction" in newton
    assert "hardly told by the casts: a" in newton
