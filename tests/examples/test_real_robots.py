"""Real logs whose MJCF has no friction, or too much: docs/your_robot.md says what is found."""

from pathlib import Path
from typing import Any

import pytest

from robotcast.diagnosis.diagnose import diagnose
from robotcast.diagnosis.rule import Effort, Rule
from robotcast.robots.robot_case import read_case

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def said_of(robot: str) -> tuple[dict[str, Any], list[float], dict[str, Any]]:
    """Diagnose; return all that is said, the ladder's errors, and the sizes."""
    case = read_case(EXAMPLES / robot)
    said = diagnose(case.question((), (), Rule(), Effort()), lambda known: None)
    errors = [rung["heldout_typical_error_percent"] for rung in said["ladder"]]
    sizes = {row["effect"]: row["parameters"] for row in said["ranking"]}
    return said, errors, sizes


@pytest.mark.slow
def test_dry_friction_is_named_in_both_joints_and_not_the_richer_law_that_does_no_better() -> None:
    said, errors, sizes = said_of("double_pendulum")
    found = {"dry_friction_shoulder", "dry_friction_elbow", "armature_elbow"}
    assert set(said["verdict"]) == found
    assert errors[-1] < 0.1 * errors[0]
    torque = sizes["dry_friction_shoulder"]["torque"]
    assert torque["low"] < 0.25 < torque["high"]  # N m in motion, as its makers identified it


@pytest.mark.slow
def test_dry_friction_is_named_in_a_joint_that_was_swung_up_once() -> None:
    said, errors, sizes = said_of("swing_up")
    assert said["verdict"] == ["dry_friction_shoulder"]
    assert errors[-1] < 1.5 * said["noise_floor_percent"] < errors[0]
    torque = sizes["dry_friction_shoulder"]["torque"]
    assert torque["low"] < 0.29 < torque["high"]  # N m in motion, as its makers identified it


@pytest.mark.slow
def test_the_friction_of_a_cube_that_is_tossed_onto_a_board_is_named() -> None:
    said, errors, sizes = said_of("tossed_cube")
    assert said["verdict"] == ["contact_friction"]
    assert errors[-1] < 0.5 * errors[0]
    factor = sizes["contact_friction"]["k"]
    low, high = 1 + factor["low"], 1 + factor["high"]
    assert low < 0.185 and 0.175 < high < 0.3  # its makers identified 0.18, to two digits
