"""Every optimizer has its row, its trace and its doubts in the report."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from robotcast.reporting.figures import trace_figure
from robotcast.reporting.report import RunFacts, make_report
from robotcast.reporting.results import Results, read_results
from robotcast.reporting.tables import tuning_table
from robotcast.tuning.revisions import Revision

NAMES = {"de": "DE", "bo": "BO (EI)", "gn": "Gauss–Newton"}
REVISION = Revision(
    cable="cable1", rig="virtual", split="a", tuning_casts=20, heldout_casts=30,
    simulator="segmented", optimizer="de", effects=("board_tilt",),
    tuning_waypoint_error_percent=2.0, heldout_waypoint_error_percent=2.0,
    heldout_final_error_percent=2.0, standard_error_percent=None, noise_floor_percent=None,
    simulated_casts=100,
)  # fmt: skip


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


def test_every_simulator_has_a_row_for_every_optimizer(results: Results) -> None:
    labels = [row.labels[0] for row in tuning_table(results).rows]
    assert labels == [
        *(f"{s}, {o}" for s in ("PyBullet", "Hybrid", "Segmented") for o in _ordered()),
        "Noise floor (repeats)",
    ]


def _ordered() -> list[str]:
    return [NAMES[name] for name in ("de", "bo", "gn")]


def test_a_row_with_an_effect_stands_where_it_helps(results: Results) -> None:
    first = results.cables[0]
    base = next(t for t in results.tunings if (t.cable, t.optimizer) == (first.name, "de"))
    error = base.error("test", "waypoint_percent") or 0.0
    helps = replace(REVISION, cable=first.name, heldout_waypoint_error_percent=error - 0.5)
    hurts = replace(helps, effects=("air_drag",), heldout_waypoint_error_percent=error + 0.5)
    cables = (replace(first, revisions=(helps, hurts)), *results.cables[1:])
    rows = {r.labels[0]: r for r in tuning_table(replace(results, cables=cables)).rows}
    assert "Segmented, DE + air drag" not in rows
    shown = rows["Segmented, DE + board tilt"].cells
    assert shown[0].value == error - 0.5
    assert [cell.value for cell in shown[2:]] == [None] * 10  # of other cables, and the paper


def test_the_caption_says_who_was_given_how_much(results: Results) -> None:
    assert "Tuned to: " not in tuning_table(results).caption
    fewer = {**results.tunings[0].facts, "simulated_casts": 48}
    tunings = (replace(results.tunings[0], facts=fewer), *results.tunings[1:])
    caption = tuning_table(replace(results, tunings=tunings)).caption
    assert "Tuned to: Segmented, BO (EI) 30 casts, 48 simulated; " in caption


def test_every_optimizer_has_a_trace(results: Results) -> None:
    (legend,) = trace_figure(results.tunings, {"cable1": 0.8}).legends
    assert {text.get_text() for text in legend.get_texts()} == {
        *(f"Segmented, {name}" for name in NAMES.values()),
        "noise floor",
    }


def test_a_simulator_with_an_effect_stands_beside_the_one_without(results: Results) -> None:
    base = next(t for t in results.tunings if (t.cable, t.optimizer) == ("cable1", "de"))
    better = {"test": {**base.facts["errors"]["test"], "waypoint_percent": 0.1}}
    facts = {**base.facts, "effects": ["board_tilt"], "errors": {**base.facts["errors"], **better}}
    both = replace(results, tunings=(*results.tunings, replace(base, facts=facts)))
    (legend,) = trace_figure(both.tunings, {}).legends
    drawn = {text.get_text() for text in legend.get_texts()}
    assert {"Segmented, DE", "Segmented, DE + board tilt"} < drawn
    report = make_report(both, RunFacts("demo", 0, ()))
    figures = {figure.name for of in report.figures.values() for figure in of}
    assert "overlay_cable1_segmented-de-board_tilt" in figures
    assert any(text.startswith("Segmented, DE + board tilt: ") for _, text in report.run)


def test_the_run_says_what_to_doubt(results: Results) -> None:
    said = [text for _, text in make_report(results, RunFacts("demo", 0, ())).run]
    (newton,) = (text for text in said if "Segmented, Gauss–Newton:" in text)
    assert "12 diverged" in newton
    assert "at a bound: planar_friction" in newton
    assert "hardly told by the casts: a" in newton
