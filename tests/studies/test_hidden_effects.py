"""The benchmark from drawing to scores, on smaller sets than `make hidden-effects-few` has."""

import subprocess
import sys
from pathlib import Path

import pytest
from omegaconf import OmegaConf

from robotcast.build import build, known_effects
from studies.hidden_effects.cases import draw_cases
from studies.hidden_effects.layout import result
from studies.hidden_effects.outcomes import Outcome, read_outcomes
from tests.test_pipeline import reached, stages

ROOT = Path(__file__).resolve().parents[2]
CANDIDATES = ("air_drag", "board_tilt", "camera_latency")  # a few, to be quick
FORCED = "case-001"
SETTINGS = (
    *(f"brute_force=[{FORCED}]", "counts={actions:10,repeated:2,times:2}"),
    *("composition.effects=[board_tilt]", "composition.controls=[]"),
)


def run(stage: str, folder: Path) -> None:
    command = [sys.executable, "-m", f"studies.hidden_effects.{stage}", "--config-name", "few"]
    command += [f"hidden_effects.{setting}" for setting in (f"folder={folder}", *SETTINGS)]
    command += [f"hidden_effects.reports={folder}"]
    command += [f"exclude=[{','.join(sorted({*known_effects()} - {*CANDIDATES}))}]"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


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
def test_every_method_says_what_it_is_asked_of_every_set(outcomes: list[Outcome]) -> None:
    assert {o.kind for o in outcomes} == {"single", "outside"}
    for outcome in outcomes:
        said = outcome.said
        assert set(said["diagnosis"].names) <= {*CANDIDATES, "none", "unknown"}
        for method in ("random", "largest_sensitivity"):
            assert said[method].names[0] in CANDIDATES
        assert ("brute_force" in said) == (outcome.case == FORCED)
        assert outcome.case != FORCED or (said["brute_force"].casts or 0) > 1000
        assert ("oracle" in said) == (outcome.kind == "single")
        assert "oracle" not in said or set(said["oracle"].intervals) >= set(outcome.sizes())


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
