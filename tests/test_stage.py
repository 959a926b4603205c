"""What is typed is taken as it stands, and what goes wrong is said in one line."""

from pathlib import Path

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import InstantiationException

from robotcast import stage as stage_module
from robotcast.measurements.reader import write_measurement_set
from robotcast.stage import _names, _sentence, as_typed, bar
from tests.good_casts import good_set
from tests.stages import ROOT, run_stage

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


@pytest.mark.parametrize(
    ("stage", "given", "said"),
    [
        ("compare", (), "measurements=DIR is needed"),
        ("diagnose", (f"measurements={ROOT}",), "output=DIR is needed"),
        ("compare", (f"measurements={ROOT}/none", "output=out"), "there is no such folder"),
        ("diagnose", (f"measurements={ROOT}", "output=out"), "rig.yaml is missing"),
    ],
)
def test_what_is_missing_is_named_in_one_line(stage: str, given: tuple[str], said: str) -> None:
    status, told = run_stage(stage, *given)
    assert status == 2 and said in told


def test_outputs_are_tried_before_the_work(tmp_path: Path) -> None:
    folder = tmp_path / "Würfe (2)"
    write_measurement_set(good_set(), folder)
    (tmp_path / "file").write_text("hi")
    for stage, output, refusal in (
        ("compare", tmp_path / "file" / "out", "file: is a file; name a folder to write to"),
        ("diagnose", f"{tmp_path}/x/../Würfe (2)", "is the folder that is read; name another"),
    ):
        status, said = run_stage(stage, f"measurements={folder}", f"output={output}")
        assert status == 2 and refusal in said
    status, said = run_stage(
        "tune", f"paths.measurements={folder}", f"paths.tuned={tmp_path}/out", "effects=tilt+drag"
    )
    assert status == 2 and "3" in said


def test_where_no_terminal_shows_a_bar_lines_say_where_a_stage_stands(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(stage_module, "TELL_EVERY_S", 0.0)
    with bar("diagnose") as progress:
        progress(40, 0, "simulated windows")
    assert "diagnose: 40 of ? simulated windows" in capsys.readouterr().err
