"""Every dvc.yaml says what its stages depend on: enough that nothing stale stays, and no more."""

import ast
import re
import subprocess
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]
PAPER = "hide collect track tune generate candidates train evaluate baseline"
LOOP = "compare diagnose revise generate_revised train_revised evaluate_revised"

# How a stage starts, shows its progress, works in processes and puts a file in place changes no
# result, nor does what is drawn instead of cast, or beside the results while they are made. No
# pipeline diagnoses a robot.
PLUMBING = {
    ROOT / "src/robotcast" / f"{name}.py"
    for name in (
        *("stage", "workflow/commissioning", "files", "processes", "running"),
        *("reporting/revisions_page", "workflow/diagnosing_robot"),
    )
}


def stages(folder: str) -> dict[str, dict[str, Any]]:
    pipeline = yaml.safe_load((ROOT / folder / "dvc.yaml").read_text(encoding="utf-8"))["stages"]
    return {name: entry.get("do", entry) for name, entry in pipeline.items()}


STAGES = [
    pytest.param(stage, id=f"{path.parent.name}-{name}" if path.parent != ROOT else name)
    for path in (ROOT / "dvc.yaml", *sorted(ROOT.glob("studies/*/dvc.yaml")))
    for name, stage in stages(str(path.parent)).items()
]


def module_file(module: str) -> Path | None:
    """Return the file of a module of this repository."""
    files = (root.joinpath(*module.split(".")).with_suffix(".py") for root in (ROOT / "src", ROOT))
    return next((file for file in files if file.is_file()), None)


@cache
def imports(file: Path) -> tuple[Path, ...]:
    found: list[Path] = []
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        found += filter(None, map(module_file, names))
    return tuple(found)


def files_of(pattern: str) -> Iterator[Path]:
    """Yield the configurations that a name of a pipeline, with its variables, may mean."""
    for path in ROOT.glob(re.sub(r"\$\{[^}]*\}", "*", pattern)):
        yield from path.glob("*.yaml") if path.is_dir() else (path,)


def configurations(stage: dict[str, Any]) -> list[str]:
    params = [next(iter(entry)) for entry in stage.get("params", []) if isinstance(entry, dict)]
    return [*params, *(dep for dep in stage["deps"] if dep.startswith("conf/"))]


def configured(stage: dict[str, Any]) -> Iterator[Path]:
    """Yield the files of the classes that the stage's own config files name."""
    for pattern in configurations(stage):
        for path in files_of(pattern):
            for target in re.findall(r"_target_:\s*(robotcast\.[\w.]+)", path.read_text("utf-8")):
                module = target.rpartition(".")[0]
                found = module_file(module) or module_file(module.rpartition(".")[0])
                assert found is not None, f"{path}: {target} does not exist"
                yield found


def started(stage: dict[str, Any]) -> Iterator[Path]:
    """Yield the scripts that a stage runs; another stage that its own starts is a dependency."""
    for module in re.findall(r"python -m ([\w.]+)", stage["cmd"]):
        yield module_file(module) or ROOT / module
    scripts = re.findall(r"python ([\w/]+\.py)", stage["cmd"])
    for script in {*scripts, *(d for d in stage["deps"] if d.startswith("stages/"))}:
        yield ROOT / script


def reached(stage: dict[str, Any]) -> set[str]:
    waiting, seen = [*started(stage), *configured(stage)], set[Path]()
    while waiting:
        file = waiting.pop()
        if file not in seen | PLUMBING:
            seen.add(file)
            waiting.extend(imports(file))
    return {file.relative_to(ROOT).as_posix() for file in seen}


def covers(deps: list[str], file: str) -> bool:
    return any(file == dep or file.startswith(f"{dep}/") for dep in deps)


def test_the_pipeline_is_the_papers_and_the_loop() -> None:
    assert " ".join(stages(".")) == f"{PAPER} {LOOP} report"


@pytest.mark.parametrize("stage", STAGES)
def test_a_stage_depends_on_all_the_code_it_runs_and_on_no_other(stage) -> None:
    files, deps = reached(stage), stage["deps"]
    assert not sorted(file for file in files if not covers(deps, file))
    code = [dep for dep in deps if dep.startswith(("src/", "stages/")) or dep.endswith(".py")]
    assert not [dep for dep in code if not any(covers([dep], file) for file in files)]


@pytest.mark.parametrize("stage", STAGES)
def test_params_name_config_files_that_exist(stage) -> None:
    for pattern in configurations(stage):
        assert list(files_of(pattern)), pattern


def test_recorded_casts_outlive_a_rerun() -> None:
    (out,) = stages(".")["collect"]["outs"]
    (options,) = out.values()
    assert options["persist"] is True


def test_only_what_hides_and_what_reports_reads_what_is_hidden() -> None:
    sealed = [
        name
        for name, stage in stages(".").items()
        if any(dep.startswith("data/hidden") for dep in stage["deps"])
    ]
    assert sealed == ["collect", "evaluate", "baseline", "evaluate_revised", "report"]


def test_a_simulator_parameter_reruns_tuning_and_generating_but_no_cast() -> None:
    readers = [
        name
        for name, stage in stages(".").items()
        if any(pattern.startswith("conf/simulator/") for pattern in configurations(stage))
    ]
    assert readers == ["tune", "generate", "compare", "diagnose", "revise", "generate_revised"]


@pytest.mark.parametrize("git", [True, False])
def test_without_git_dvc_is_told_so_whenever_the_pipeline_runs(tmp_path: Path, git: bool) -> None:
    """An archive unpacked beside an environment that is there already needs no other step."""
    (tmp_path / "Makefile").write_bytes((ROOT / "Makefile").read_bytes())
    if git:
        (tmp_path / ".git").mkdir()
    command = ["make", "-n", "-o", ".venv/.installed", "repro"]
    said = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    assert ("core.no_scm true" in said) is not git
    assert "dvc repro hide candidates" in said
