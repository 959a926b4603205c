"""The command `robotcast`."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from robotcast import cli

ROOT = Path(__file__).resolve().parents[1]


def run(*arguments: str, **more: str) -> str:
    command = [sys.executable, "-m", "robotcast.cli", *arguments]
    done = subprocess.run(
        command, cwd=ROOT, env={**os.environ, **more}, capture_output=True, text=True
    )
    return done.stdout + done.stderr


def test_a_folder_as_the_first_word_is_the_set_and_what_is_given_wins() -> None:
    assert cli.overrides("diagnose", ["sets/a b/", "output=OUT"]) == [
        *("measurements='sets/a b/'", "output='outputs/a b/diagnosis'", "output=OUT")
    ]
    assert "paths.measurements='sets/one'" in cli.overrides("tune", ["sets/one"])
    for given in ([], ["seed=1"], ["-m", "seed=1,2"], ["+more=1"]):
        assert cli.overrides("diagnose", given) == given
    assert cli.overrides("collect", ["casts"]) == ["casts"]


def test_a_robot_s_folder_as_the_first_word_is_known_by_its_robot_yaml(tmp_path: Path) -> None:
    assert cli.overrides("describe", [str(tmp_path)]) == [f"robot='{tmp_path}'"]
    (tmp_path / "robot.yaml").touch()
    assert cli.overrides("tune", [str(tmp_path), "seed=1"]) == [
        *("model='mjcf'", f"robot='{tmp_path}'", f"output='outputs/{tmp_path.name}/tune'", "seed=1")
    ]


def test_a_quote_in_a_name_reaches_the_stage(tmp_path: Path) -> None:
    (tmp_path / "it's").mkdir()
    assert f"{tmp_path}/it's: rig.yaml is missing" in " ".join(
        run("compare", str(tmp_path / "it's")).split()
    )


def test_the_stages_are_listed_and_another_name_is_refused() -> None:
    listed = run()
    for script in (ROOT / "stages").glob("*.py"):
        assert f"  {script.stem} " in listed
    assert "there is no diagnos; there are" in run("diagnos")


def test_stages_and_settings_are_completed() -> None:
    assert run("-sc", "query=bash", COMP_LINE="robotcast di").split() == ["diagnose"]
    line = "robotcast diagnose sets/one simulator="
    assert "simulator=hybrid" in run("-sc", "query=bash", COMP_LINE=line).split()
    assert "-F hydra_bash_completion" in run("-sc", "install=bash")


def test_elsewhere_than_in_its_repository_it_says_how_to_install_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cli, "CONFIGURATION", tmp_path)
    with pytest.raises(SystemExit, match=r"pip install -e \."):
        cli.main()
