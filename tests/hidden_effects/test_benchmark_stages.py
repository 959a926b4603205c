"""The benchmark from drawing to scores, on smaller sets than `make hidden-effects-few` has."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from robotcast.hidden_effects.layout import diagnosis_path, oracle_path, results_folder, rivals_path
from robotcast.hidden_effects.outcome import Outcome, read_outcomes

ROOT = Path(__file__).resolve().parents[2]
CANDIDATES = ("air_drag", "board_tilt", "camera_latency")  # a few, to be quick
FORCED = "case-001"
SAID = (diagnosis_path, rivals_path, oracle_path)


def run(stage: str, folder: Path) -> None:
    command = [sys.executable, f"stages/hidden_{stage}.py", "hidden_effects=few"]
    command += [f"hidden_effects.folder={folder}", f"hidden_effects.reports={folder}"]
    known = yaml.safe_load((ROOT / "conf" / "effects.yaml").read_text(encoding="utf-8"))["effects"]
    command += [f"exclude=[{','.join(name for name in known if name not in CANDIDATES)}]"]
    command += [f"hidden_effects.brute_force=[{FORCED}]"]
    command += ["hidden_effects.counts={actions:10,repeated:2,times:2}"]
    command += ["hidden_effects.composition.effects=[board_tilt]"]
    command += ["hidden_effects.composition.controls=[]"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def read(path: Path) -> dict[str, Any]:
    return json.loads(path.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("few")
    for stage in ("draw", "diagnose", "rivals", "score"):
        run(stage, folder)
    return folder


@pytest.fixture(scope="module")
def outcomes(folder: Path) -> list[Outcome]:
    return read_outcomes(folder)


@pytest.mark.slow
def test_every_set_gets_a_verdict_of_what_was_offered(outcomes: list[Outcome]) -> None:
    assert {o.truth.kind for o in outcomes} == {"single", "outside"}
    for outcome in outcomes:
        assert outcome.diagnosis is not None
        assert set(outcome.diagnosis.verdict) <= {*CANDIDATES, "none", "unknown"}


@pytest.mark.slow
def test_the_oracle_is_told_single_effects(outcomes: list[Outcome]) -> None:
    told = {o.truth.kind: o.oracle for o in outcomes}
    assert told["outside"] is None
    for outcome in outcomes:
        if outcome.truth.kind == "single":
            assert outcome.oracle is not None
            assert set(outcome.oracle.intervals) >= set(outcome.truth.sizes)


@pytest.mark.slow
def test_every_rival_names_an_effect_and_brute_force_only_where_asked(
    outcomes: list[Outcome],
) -> None:
    for outcome in outcomes:
        assert outcome.random in CANDIDATES
        assert outcome.largest_sensitivity in CANDIDATES
        assert (outcome.brute_force is not None) == (outcome.case == FORCED)


@pytest.mark.slow
def test_what_stands_is_not_done_again(folder: Path, outcomes: list[Outcome]) -> None:
    paths = [path(o.case, folder) for o in outcomes for path in SAID]
    before = {path: path.stat().st_mtime_ns for path in paths if path.exists()}
    for stage in ("diagnose", "rivals"):
        run(stage, folder)
    assert {path: path.stat().st_mtime_ns for path in paths if path.exists()} == before


@pytest.mark.slow
def test_the_results_are_written_for_people(folder: Path) -> None:
    text = (results_folder(folder) / "README.md").read_text(encoding="utf-8")
    assert "2 of them were diagnosed" in text
    assert read(rivals_path(FORCED, folder))["brute_force"]["simulated_casts"] > 1000
