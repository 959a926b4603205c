"""A real double pendulum, whose MJCF has no friction: docs/your_robot.md says what is found."""

from pathlib import Path

import pytest

from robotcast.diagnosis.diagnose import diagnose
from robotcast.diagnosis.rule import Effort, Rule
from robotcast.robots.robot_case import read_case

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "double_pendulum"


@pytest.mark.slow
def test_dry_friction_is_named_in_both_joints_and_not_the_richer_law_that_does_no_better() -> None:
    case = read_case(FOLDER)
    said = diagnose(case.question((), (), Rule(), Effort()), lambda known: None)
    found = {"dry_friction_shoulder", "dry_friction_elbow", "armature_elbow"}
    assert set(said["verdict"]) == found
    before, *_, after = (rung["heldout_typical_error_percent"] for rung in said["ladder"])
    assert after < 0.1 * before
    sizes = {row["effect"]: row["parameters"] for row in said["ranking"]}
    torque = sizes["dry_friction_shoulder"]["torque"]
    assert torque["low"] < 0.25 < torque["high"]  # N m in motion, as its makers identified it
    confused = {frozenset(some) for some in said["confusion_set"]}
    assert {"dry_friction_elbow", "stribeck_friction_elbow"} in confused
