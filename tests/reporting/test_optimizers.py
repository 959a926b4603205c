"""Every optimizer has its row, its trace and its doubts in the report."""

import shutil
from pathlib import Path

import pytest
import yaml

from robotcast.reporting.figures.trace import trace_figure
from robotcast.reporting.report import RunFacts, make_page
from robotcast.reporting.results import Results, read_results
from robotcast.reporting.tables import tuning_table

NAMES = {"de": "DE", "bo": "BO (EI)", "gn": "Gauss–Newton"}


@pytest.fixture(scope="module")
def results(data_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Results:
    folder = tmp_path_factory.mktemp("optimizers") / "data"
    shutil.copytree(data_folder, folder)
    tuned = folder / "tuned" / "cable1"
    for optimizer in ("bo", "gn"):
        path = shutil.copytree(tuned / "segmented-de", tuned / f"segmented-{optimizer}")
        facts = yaml.safe_load((path / "tuned.yaml").read_text())
        facts |= {"optimizer": optimizer, "diverged_casts": 12}
        facts["certainty"] = {"condition": 4e3, "least_known": ["a", "b"], "vague": ["a"]}
        (path / "tuned.yaml").write_text(yaml.safe_dump(facts))
    return read_results(folder)


def test_every_optimizer_has_a_row(results: Results) -> None:
    labels = [row.labels[0] for row in tuning_table(results).rows]
    assert {f"Segmented, {name}" for name in NAMES.values()} < set(labels)


def test_every_optimizer_has_a_trace(results: Results) -> None:
    (legend,) = trace_figure(results.tunings, {"cable1": 0.8}).legends
    assert {text.get_text() for text in legend.get_texts()} == {
        *(f"Segmented {name}" for name in NAMES.values()),
        "noise floor",
    }


def test_the_run_says_what_to_doubt(results: Results) -> None:
    said = [text for _, text in make_page(results, RunFacts("demo", 0, ())).run]
    (newton,) = (text for text in said if "by Gauss–Newton" in text)
    assert "12 diverged" in newton
    assert "at a bound: planar_friction" in newton
    assert "hardly told by the casts: a" in newton
