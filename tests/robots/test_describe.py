"""describe guesses robot.yaml from names, and what it writes runs."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest
import yaml

from robotcast.robots.describe import describe
from robotcast.robots.robot_case import read_case
from tests.robots.made_up_robot import ARM, write_folder


def folder_with(tmp_path: Path, names: dict[str, str], degrees: bool = False) -> Path:
    """Return an arm's folder without robot.yaml, its columns called otherwise."""
    folder = write_folder(tmp_path, ARM, logs=2)
    (folder / "robot.yaml").unlink()
    for path in folder.glob("*.csv"):
        table = pl.read_csv(path)
        if degrees:
            table = table.with_columns(pl.col("q_shoulder", "q_elbow").degrees())
        table.rename(names).write_csv(path)
    return folder


@pytest.mark.parametrize(
    "names",
    [
        {},
        {"t": "stamp", "q_shoulder": "pos_1", "q_elbow": "pos_2", "u_s": "cmd_1", "u_e": "cmd_2"},
        {"q_shoulder": "shoulder.position", "q_elbow": "elbow.position", "u_s": "ctrl/shoulder"},
    ],
)
def test_what_is_guessed_runs(tmp_path: Path, names: dict[str, str]) -> None:
    folder = folder_with(tmp_path, names)
    path, _ = describe(folder)
    assert next(iter(read_case(folder).robot.drive)).name == "actuator[s]"
    with pytest.raises(ValueError, match="exists already"):
        describe(folder)
    assert "measured" in yaml.safe_load(path.read_text())


def test_degrees_are_seen_in_how_far_a_joint_turns(tmp_path: Path) -> None:
    path, _ = describe(folder_with(tmp_path, {}, degrees=True))
    measured = yaml.safe_load(path.read_text())["measured"]
    assert measured["joint[shoulder].position"]["unit"] == "deg"


SERVO, MOTOR = (
    '<position name="drive" joint="elbow" kp="25"/>',
    '<motor name="drive" joint="elbow"/>',
)
GEARED = '<motor name="drive" joint="elbow" gear="50"/>'
TENDON = '<motor name="drive" tendon="cable"/>'


@pytest.mark.parametrize(
    ("actuator", "column", "target", "unit"),
    [
        (SERVO, "elbow_cmd_deg", "actuator[drive]", "deg"),
        (SERVO, "cmd_rad", "actuator[drive]", "rad"),
        (SERVO, "cmd", "actuator[drive]", None),
        (MOTOR, "tau_cmd", "actuator[drive]", None),
        (MOTOR, "elbow_torque_mNm", "actuator[drive]", "mN m"),
        (GEARED, "elbow_tau_cmd", "joint[elbow].torque", "N m"),
        (SERVO, "tau", "joint[elbow].torque", "N m"),
        (TENDON, "drive_N", "actuator[drive]", "N"),
    ],
)
def test_a_drive_and_its_unit_are_told_by_the_name_of_a_column(
    tmp_path: Path, actuator: str, column: str, target: str, unit: str | None
) -> None:
    cable = '<tendon><fixed name="cable"><joint joint="elbow" coef="0.01"/></fixed></tendon>'
    head = ARM.partition("<actuator>")[0]
    (tmp_path / "arm.xml").write_text(f"{head}{cable}<actuator>{actuator}</actuator></mujoco>")
    t = np.arange(0, 2, 0.01)
    log = {"t": t, "shoulder_pos": np.cos(t), "elbow_pos": np.sin(t), column: np.sin(t + 0.1)}
    pl.DataFrame(log).write_csv(tmp_path / "log.csv")
    path, _ = describe(tmp_path)
    drive = {target: {"column": column, **({"unit": unit} if unit else {})}}
    assert yaml.safe_load(path.read_text())["drive"] == drive


def test_a_servo_that_is_commanded_far_more_than_its_joint_turns_is_so_in_degrees(
    tmp_path: Path,
) -> None:
    folder = folder_with(tmp_path, {})
    for log in folder.glob("*.csv"):
        pl.read_csv(log).with_columns(pl.col("u_s").degrees()).write_csv(log)
    path, _ = describe(folder)
    assert yaml.safe_load(path.read_text())["drive"]["actuator[s]"]["unit"] == "deg"


def test_a_motor_that_is_logged_by_commanded_positions_asks_for_the_gains_of_its_servo(
    tmp_path: Path,
) -> None:
    folder = write_folder(tmp_path, ARM, logs=2)
    wanted = read_case(folder).model
    servo = '<position name="s" joint="shoulder" kp="25" kv="1.2"/>'
    motor = '<motor name="s" joint="shoulder" gear="-50"/>'
    (folder / "robot.xml").write_text(ARM.replace(servo, motor))
    (folder / "robot.yaml").unlink()
    path, said = describe(folder)
    assert any("actuator[s]: motors of torque" in sentence for sentence in said)
    with pytest.raises(ValueError, match=r"servos actuator.s.: expected .kp"):
        read_case(folder)
    path.write_text(path.read_text().replace("kp: , kd: ", "kp: 25, kd: 1.2 "))
    found = read_case(folder).model
    assert [one.tolist() for one in found.nominal_misses] == [
        one.tolist() for one in wanted.nominal_misses
    ]


def test_a_joint_without_a_column_is_said(tmp_path: Path) -> None:
    folder = folder_with(tmp_path, {"q_shoulder": "shoulder_pos", "q_elbow": "spare"})
    _, said = describe(folder)
    assert any("no position was found for elbow" in sentence for sentence in said)


def test_a_folder_without_a_model_or_a_log_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="expected an MJCF or URDF file, one; found none"):
        describe(tmp_path)
    (tmp_path / "robot.xml").write_text(ARM)
    with pytest.raises(ValueError, match="no log"):
        describe(tmp_path)
