"""What is typed is taken as it stands, and what goes wrong is said in one line."""

import subprocess
import sys
from pathlib import Path

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import InstantiationException

from robotcast.measurements.reader import write_measurement_set
from robotcast.stage import _names, _sentence, as_typed
from tests.good_casts import good_set

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ["Würfe (2)", "a=b, c#d", "it's {new} [1]", "C:\\casts\\", "~/x $y", "plain/set-1", "'"]


def read_by_hydra(argument: str) -> object:
    return OverridesParser.create().parse_override(argument).value()


@pytest.mark.parametrize("key", ["measurements", "output", "paths.tuned", "rig.path"])
@pytest.mark.parametrize("folder", FOLDERS)
def test_a_path_may_hold_what_a_path_may_hold(key: str, folder: str) -> None:
    assert read_by_hydra(as_typed(f"{key}={folder}")) == folder


@pytest.mark.parametrize("given", ["board_tilt", "board_tilt,air_drag", "board_tilt+air_drag"])
def test_names_are_a_list_without_brackets_too(given: str) -> None:
    read = read_by_hydra(as_typed(f"effects={given}"))
    assert _names(read) == given.replace("+", ",").split(",")
    assert as_typed("effects=[board_tilt]") == "effects=[board_tilt]"


def test_what_is_no_path_is_left_alone() -> None:
    for argument in ("-m", "measurements=null", "simulator=hybrid", "optimizer.seed=1,2"):
        assert as_typed(argument) == argument
    for argument in ("paths.measurements=a,b", "effects=board_tilt,air_drag"):
        assert as_typed(argument, sweep=True) == argument


def test_errors_are_one_line() -> None:
    inner = ValueError("the cable\nis too short")
    outer = InstantiationException("Error in call to target 'x':\nValueError(...)")
    outer.__cause__ = inner
    assert _sentence(outer) == "the cable is too short"
    assert _sentence(PermissionError(13, "Permission denied", "out")) == "out: Permission denied"


def run(script: str, *arguments: str) -> tuple[int, str]:
    command = [sys.executable, f"stages/{script}.py", *arguments]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert "Traceback" not in done.stderr
    return done.returncode, " ".join(done.stderr.split())


def test_outputs_are_tried_before_the_work(tmp_path: Path) -> None:
    folder = tmp_path / "Würfe (2)"
    write_measurement_set(good_set(), folder)
    (tmp_path / "file").write_text("hi")
    status, said = run("compare", f"measurements={folder}", f"output={tmp_path / 'file' / 'out'}")
    assert status == 2 and "file: is a file; name a folder to write to" in said
    status, said = run("compare", f"measurements={folder}", f"output={tmp_path}/x/../Würfe (2)")
    assert status == 2 and "is the folder that is read; name another to write to" in said
    status, said = run(
        "tune", f"paths.measurements={folder}", f"paths.tuned={tmp_path}/out", "effects=tilt+drag"
    )
    assert status == 2 and "3" in said
