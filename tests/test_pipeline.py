"""dvc.yaml says what every stage depends on: enough, so that nothing stale stays, and no more."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]
ORDER = (
    *("collect", "track", "tune", "generate", "candidates"),
    *("train", "evaluate", "baseline", "report"),
)

# How a stage starts, shows its progress, works in processes and puts a file in place changes no
# result, nor does what is drawn instead of cast.
PLUMBING = (
    *("stages/stage.py", "stages/dry_run.py"),
    *(f"src/robotcast/{name}.py" for name in ("files", "processes", "progress", "source")),
)


def stages() -> dict[str, dict[str, Any]]:
    pipeline = yaml.safe_load((ROOT / "dvc.yaml").read_text(encoding="utf-8"))["stages"]
    return {name: entry.get("do", entry) for name, entry in pipeline.items()}


def module_file(module: str) -> Path | None:
    """Return the file of a module of this repository; stage scripts import their neighbours."""
    for root in (ROOT / "src", ROOT / "stages"):
        file = root.joinpath(*module.split(".")).with_suffix(".py")
        if file.is_file():
            return file
    return None


def imports(file: Path) -> Iterator[Path]:
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        for name in names:
            found = module_file(name)
            if found is not None:
                yield found


def configured(stage: dict[str, Any]) -> Iterator[Path]:
    """Yield the files of the classes that the stage's own config files name."""
    for entry in stage.get("params", []):
        pattern = re.sub(r"\$\{[^}]*\}", "*", next(iter(entry)))
        for path in ROOT.glob(pattern):
            for target in re.findall(r"_target_:\s*(robotcast\.[\w.]+)\.\w+", path.read_text()):
                found = module_file(target)
                assert found is not None, f"{path}: {target} does not exist"
                yield found


def reached(stage: dict[str, Any], script: Path) -> set[str]:
    waiting, seen = [script, *configured(stage)], set[Path]()
    plumbing = {ROOT / name for name in PLUMBING}
    while waiting:
        file = waiting.pop()
        if file not in seen | plumbing:
            seen.add(file)
            waiting.extend(imports(file))
    return {file.relative_to(ROOT).as_posix() for file in seen}


def covers(deps: list[str], file: str) -> bool:
    return any(file == dep or file.startswith(f"{dep}/") for dep in deps)


def test_the_pipeline_is_the_papers() -> None:
    assert tuple(stages()) == ORDER


@pytest.mark.parametrize("name", ORDER)
def test_a_stage_depends_on_all_the_code_it_runs(name: str) -> None:
    stage = stages()[name]
    files = reached(stage, ROOT / "stages" / f"{name}.py")
    assert not sorted(file for file in files if not covers(stage["deps"], file))


@pytest.mark.parametrize("name", ORDER)
def test_a_stage_depends_on_no_code_that_it_does_not_run(name: str) -> None:
    stage = stages()[name]
    files = reached(stage, ROOT / "stages" / f"{name}.py")
    code = [dep for dep in stage["deps"] if dep.startswith(("src/", "stages/"))]
    assert not [dep for dep in code if not any(covers([dep], file) for file in files)]


def test_recorded_casts_outlive_a_rerun() -> None:
    (out,) = stages()["collect"]["outs"]
    (options,) = out.values()
    assert options["persist"] is True


def test_params_name_config_files_that_exist() -> None:
    for stage in stages().values():
        for entry in stage.get("params", []):
            pattern = re.sub(r"\$\{[^}]*\}", "*", next(iter(entry)))
            assert list(ROOT.glob(pattern)), pattern


def test_a_simulator_parameter_reruns_tuning_and_generating_but_no_cast() -> None:
    readers = {
        name
        for name, stage in stages().items()
        for entry in stage.get("params", [])
        if next(iter(entry)).startswith("conf/simulator/")
    }
    assert readers == {"tune", "generate"}
