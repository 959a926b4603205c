"""benchmarks/hidden_effects/dvc.yaml: complete, and the answers stay out of the diagnosis."""

from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
import yaml
from hydra import compose, initialize_config_dir

from robotcast.hidden_effects.draw import draw_cases
from tests.test_pipeline import covers, reached

ROOT = Path(__file__).resolve().parents[2]
ORDER = ("draw", "diagnose", "rivals", "score")


def stages() -> dict[str, dict[str, Any]]:
    file = ROOT / "benchmarks" / "hidden_effects" / "dvc.yaml"
    return yaml.safe_load(file.read_text(encoding="utf-8"))["stages"]


def files(name: str) -> set[str]:
    """Return all code that a stage runs; the diagnosis runs in a process of its own."""
    found = reached(stages()[name], ROOT / "stages" / f"hidden_{name}.py")
    if name == "diagnose":
        found |= reached(stages()[name], ROOT / "stages" / "diagnose.py")
    return found


def test_the_stages_stand_in_order() -> None:
    assert tuple(stages()) == ORDER


@pytest.mark.parametrize("name", ORDER)
def test_a_stage_depends_on_all_the_code_it_runs_and_on_no_other(name: str) -> None:
    deps, run = stages()[name]["deps"], files(name)
    assert not sorted(file for file in run if not covers(deps, file))
    code = [dep for dep in deps if dep.startswith(("src/", "stages/"))]
    assert not [dep for dep in code if not any(covers([dep], file) for file in run)]


def test_the_diagnosis_reads_no_answer() -> None:
    assert not [dep for dep in stages()["diagnose"]["deps"] if "answers" in dep]
    run = files("diagnose")
    assert not [file for file in run if file.endswith(("/seal.py", "/mechanisms.py"))]


def test_what_stands_outlives_a_rerun() -> None:
    for name in ORDER[:-1]:
        for out in stages()[name]["outs"]:
            (options,) = out.values()
            assert options["persist"] is True


def test_brute_force_runs_on_cases_of_every_kind(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "stages")
    composition = import_module("hidden_draw").build_composition
    with initialize_config_dir(str(ROOT / "conf"), version_base=None):
        settings = compose("config").hidden_effects
    cases = {c.name: c for c in draw_cases(composition(settings), settings.seed)}
    forced = [cases[name] for name in settings.brute_force]
    assert {case.kind for case in forced} == {"control", "single", "pair", "outside"}
    assert {case.strength for case in forced} >= {"weak", "strong"}
    assert {case.cable for case in forced} == {"cable1", "cable2", "cable3"}
