"""The benchmark from drawing to scores, on smaller sets than `make hidden-effects-few` has."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from omegaconf import OmegaConf

from robotcast.build import build
from studies.hidden_effects.cases import draw_cases
from studies.hidden_effects.layout import result
from studies.hidden_effects.outcomes import Outcome, read_outcomes
from tests.test_pipeline import reached, stages

ROOT = Path(__file__).resolve().parents[2]
CANDIDATES = ("air_drag", "board_tilt", "camera_latency")  # a few, to be quick
FORCED = "case-001"


def run(stage: str, folder: Path) -> None:
    command = [sys.executable, "-m", f"studies.hidden_effects.{stage}", "--config-name", "few"]
    command += [f"hidden_effects.folder={folder}", f"hidden_effects.reports={folder}"]
    known = OmegaConf.load(ROOT / "conf" / "effects.yaml").effects
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
    assert {o.kind for o in outcomes} == {"single", "outside"}
    for outcome in outcomes:
        assert outcome.diagnosis is not None
        assert set(outcome.diagnosis.names) <= {*CANDIDATES, "none", "unknown"}


@pytest.mark.slow
def test_the_oracle_is_told_single_effects(outcomes: list[Outcome]) -> None:
    told = {o.kind: o.said.get("oracle") for o in outcomes}
    assert told["outside"] is None
    for outcome in outcomes:
        if outcome.kind == "single":
            assert set(outcome.said["oracle"].intervals) >= set(outcome.sizes())


@pytest.mark.slow
def test_every_rival_names_an_effect_and_brute_force_only_where_asked(
    outcomes: list[Outcome],
) -> None:
    for outcome in outcomes:
        for method in ("random", "largest_sensitivity"):
            assert outcome.said[method].names[0] in CANDIDATES
        assert ("brute_force" in outcome.said) == (outcome.case == FORCED)


@pytest.mark.slow
def test_what_stands_is_not_done_again(folder: Path, outcomes: list[Outcome]) -> None:
    kinds = ("diagnoses", "rivals", "oracle")
    paths = [result(kind, o.case, folder) for o in outcomes for kind in kinds]
    before = {path: path.stat().st_mtime_ns for path in paths if path.exists()}
    for stage in ("diagnose", "rivals"):
        run(stage, folder)
    assert {path: path.stat().st_mtime_ns for path in paths if path.exists()} == before


@pytest.mark.slow
def test_the_results_are_written_for_people(folder: Path) -> None:
    text = (folder / "results" / "README.md").read_text(encoding="utf-8")
    assert "2 of them were diagnosed" in text
    assert read(result("rivals", FORCED, folder))["brute_force"]["simulated_casts"] > 1000


def test_the_diagnosis_reads_no_answer() -> None:
    diagnosis = stages("studies/hidden_effects")["diagnose"]
    assert not [dep for dep in diagnosis["deps"] if "answers" in dep]
    assert "src/robotcast/rigs/virtual/hiding.py" not in reached(diagnosis)


def test_what_stands_outlives_a_rerun() -> None:
    pipeline = stages("studies/hidden_effects")
    assert tuple(pipeline) == ("draw", "diagnose", "rivals", "score")
    for name in ("draw", "diagnose", "rivals"):
        for out in pipeline[name]["outs"]:
            (options,) = out.values()
            assert options["persist"] is True


def test_brute_force_runs_on_cases_of_every_kind() -> None:
    settings = OmegaConf.load(ROOT / "studies/hidden_effects/full.yaml").hidden_effects
    cases = {c.name: c for c in draw_cases(build(settings.composition), settings.seed)}
    forced = [cases[name] for name in settings.brute_force]
    assert {case.kind for case in forced} == {"control", "single", "pair", "outside"}
    assert {case.strength for case in forced} >= {"weak", "strong"}
    assert {case.cable for case in forced} == {"cable1", "cable2", "cable3"}
