"""The diagnose stage as users run it, on a few of the shared casts."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from robotcast.casts.table import read_actions
from robotcast.measurements.reader import read_measurement_set, write_measurement_set
from tests.stages import ROOT, run_stage

CASTING = ROOT.parent / "shared" / "data" / "casting" / "d"
TRIED = ("board_tilt", "camera_latency")


@pytest.mark.slow
@pytest.mark.skipif(not CASTING.exists(), reason="needs ../shared/data/casting")
def test_three_casts_without_a_tool_log_get_the_best_answer_that_they_allow(tmp_path: Path) -> None:
    whole = read_measurement_set(CASTING)
    given, output = tmp_path / "set", tmp_path / "out"
    write_measurement_set(replace(whole, trials=whole.trials[:3]), given)
    (given / "tool.csv").unlink()
    known = yaml.safe_load((ROOT / "conf" / "effects.yaml").read_text(encoding="utf-8"))["effects"]
    left_out = ",".join(sorted(set(known) - set(TRIED)))
    settings = (f"measurements={given}", f"output={output}", f"exclude=[{left_out}]")
    status, told = run_stage("diagnose", *settings)
    assert status == 0, told
    said = json.loads((output / "diagnosis.json").read_text())
    assert said["finished"] and not said["conclusive"] and said["verdict"] == ["none"]
    assert said["sentence"].startswith("3 casts of 3 actions are too few")
    log, few, repeats, *_ = said["notes"]
    assert log.startswith("The tool log is missing")
    assert few.startswith("The set has 3 casts") and "No action was repeated" in repeats
    assert {row["effect"] for row in said["ranking"]} == set(TRIED)
    assert said["noise_floor_percent"] is None and said["ladder"] == []
    page = (output / "index.html").read_text()
    assert "Too few data" in page and "collect.actions=" in page
    assert len(read_actions(output / "actions.csv")) == len(said["next_actions"]) == 8
