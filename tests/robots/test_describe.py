"""describe guesses robot.yaml from names, and what it writes runs."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest
import yaml

from robotcast.robots.describe import describe
from robotcast.robots.robot_case import read_case
from tests.robots.made_up_robot import ARM, rewrite, write_folder


def folder_with(tmp_path: Path, names: dict[str, str], *columns: pl.Expr) -> Path:
    """Return an arm's folder without robot.yaml, columns replaced and then called otherwise."""
    folder = rewrite(write_folder(tmp_path, ARM, logs=2), *columns)
    (folder / "robot.yaml").unlink()
    for path in folder.glob("*.csv"):
        pl.read_csv(path).rename(names).write_csv(path)
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


@pytest.mark.parametrize(
    ("columns", "part", "name"),
    [
        (pl.col("q_shoulder", "q_elbow").degrees(), "measured", "joint[shoulder].position"),
        (pl.col("u_s").degrees(), "drive", "actuator[s]"),  # far more than its joint turns
    ],
)
def test_degrees_are_seen_in_how_far_a_joint_turns_and_is_commanded(
    tmp_path: Path, columns: pl.Expr, part: str, name: str
) -> None:
    path, _ = describe(folder_with(tmp_path, {}, columns))
    assert yaml.safe_load(path.read_text())[part][name]["unit"] == "deg"


def test_what_rolls_far_because_others_push_it_turns_in_radians(tmp_path: Path) -> None:
    ball = '<body pos="0 0 1"><joint name="ball" axis="0 1 0"/><geom size=".1"/></body></worldbody>'
    folder = folder_with(tmp_path, {})
    model = folder / "robot.xml"
    model.write_text(model.read_text().replace("</worldbody>", ball))
    for path in folder.glob("*.csv"):
        pl.read_csv(path).with_columns((30 * pl.col("t")).alias("q_ball")).write_csv(path)
    path, _ = describe(folder)
    assert yaml.safe_load(path.read_text())["measured"]["joint[ball].position"]["unit"] == "rad"


SERVO = '<position name="drive" joint="elbow" kp="25"/>'
MOTOR = '<motor name="drive" joint="elbow"/>'
GEARED = '<motor name="drive" joint="elbow" gear="50"/>'
SERVO_OF_SHOULDER = '<position name="s" joint="shoulder" kp="25" kv="1.2"/>'
MOTOR_OF_SHOULDER = '<motor name="s" joint="shoulder" gear="-5" ctrlrange="-40 40"/>'
VALVE = '<general name="drive" joint="elbow" gainprm="3"/>'
TENDON = '<motor name="drive" tendon="cable"/>'
PULL = '<position name="drive" tendon="cable" kp="900"/>'


@pytest.mark.parametrize(
    ("actuator", "column", "target", "unit"),
    [
        (SERVO, "elbow_cmd_deg", "actuator[drive]", "deg"),
        (SERVO, "cmd_rad", "actuator[drive]", "rad"),
        (SERVO, "cmd", "actuator[drive]", None),
        (SERVO, "goal_position", "actuator[drive]", None),
        (MOTOR, "tau_cmd", "actuator[drive]", None),
        (MOTOR, "elbow_torque_mNm", "actuator[drive]", "mN m"),
        (MOTOR, "current_mA", "actuator[drive]", "mA"),  # which then asks for its constant
        (GEARED, "elbow_tau_cmd", "joint[elbow].torque", "N m"),
        (SERVO, "tau", "joint[elbow].torque", "N m"),
        (TENDON, "drive_N", "actuator[drive]", "N"),
        (PULL, "drive_mm", "actuator[drive]", "mm"),
        (MOTOR, "elbow_Nm", "actuator[drive]", "N m"),
        (VALVE, "drive_V", "actuator[drive]", None),
        (VALVE, "drive_volts", "actuator[drive]", None),
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


def test_columns_that_no_name_tells_are_matched_in_order(tmp_path: Path) -> None:
    joints, motors, ends = "", "", ""
    for name, kind in (("J1", "hinge"), ("J2", "hinge"), ("Z", "slide")):
        joints += f'<body><joint name="{name}" type="{kind}"/><geom size="0.1"/>'
        motors, ends = (
            f'{motors}<motor name="m{name[-1].lower()}" joint="{name}"/>',
            ends + "</body>",
        )
    body = f"<worldbody>{joints}{ends}</worldbody><actuator>{motors}</actuator>"
    (tmp_path / "scara.xml").write_text(f"<mujoco>{body}</mujoco>")
    columns = ["t_s", "q1", "q2", "z_mm", "i1_mA", "i2_mA", "iz_mA"]
    pl.DataFrame({c: np.arange(0, 2, 0.01) for c in columns}).write_csv(tmp_path / "log.csv")
    said = yaml.safe_load(describe(tmp_path)[0].read_text())
    found = {at: one["column"] for at, one in (said["drive"] | said["measured"]).items()}
    drives = {"actuator[m1]": "i1_mA", "actuator[m2]": "i2_mA", "actuator[mz]": "iz_mA"}
    places = {"J1": "q1", "J2": "q2", "Z": "z_mm"}
    assert found == drives | {f"joint[{j}].position": c for j, c in places.items()}
    assert {one["unit"] for one in said["drive"].values()} == {"mA"}


@pytest.mark.parametrize("unit", ["rad", "deg"])
def test_a_motor_that_is_logged_by_commanded_positions_asks_for_the_gains_of_its_servo(
    tmp_path: Path, unit: str
) -> None:
    folder = write_folder(tmp_path, ARM.replace('<motor name="e" joint="elbow"/>', ""), logs=2)
    wanted = read_case(folder).model
    text = (folder / "robot.xml").read_text()
    (folder / "robot.xml").write_text(text.replace(SERVO_OF_SHOULDER, MOTOR_OF_SHOULDER))
    (folder / "robot.yaml").unlink()
    if unit == "deg":
        rewrite(folder, pl.col("u_s").degrees())
    path, said = describe(folder)
    assert any("actuator[s]: motors of torque" in sentence for sentence in said)
    assert yaml.safe_load(path.read_text())["drive"]["actuator[s]"]["unit"] == unit
    with pytest.raises(ValueError, match=r"servos actuator.s.: expected .kp"):
        read_case(folder)
    path.write_text(path.read_text().replace("kp: , kd: ", "kp: 25, kd: 1.2 "))
    found = read_case(folder)
    assert found.robot.model.actuator_forcerange[0].tolist() == [-40, 40]
    for one, other in zip(found.model.nominal_misses, wanted.nominal_misses, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-6, atol=1e-6)


def test_a_springy_joint_beside_servos_has_one_too(tmp_path: Path) -> None:
    motor, servo = '<motor name="e" joint="elbow"/>', '<position name="e" joint="elbow" kp="5"/>'
    folder = write_folder(tmp_path, ARM.replace(motor, servo), logs=2)
    elbow, text = '<joint name="elbow"', ARM.replace(SERVO_OF_SHOULDER, MOTOR_OF_SHOULDER)
    (folder / "robot.xml").write_text(text.replace(elbow, f'{elbow} stiffness="1"'))
    (folder / "robot.yaml").unlink()
    path, _ = describe(folder)
    assert [*yaml.safe_load(path.read_text())["servos"]] == ["actuator[*]"]


def test_a_torque_that_looks_like_its_joints_position_is_no_command(tmp_path: Path) -> None:
    like_it = pl.col("q_elbow").alias("u_e")
    path, _ = describe(folder_with(tmp_path / "named", {"u_e": "elbow_torque"}, like_it))
    assert "servos" not in yaml.safe_load(path.read_text())
    folder = folder_with(tmp_path / "springy", {}, like_it)
    model, elbow = folder / "robot.xml", '<joint name="elbow"'
    model.write_text(model.read_text().replace(elbow, f'{elbow} stiffness="1"'))
    path, _ = describe(folder)
    assert "servos" not in yaml.safe_load(path.read_text())


def test_a_joint_without_a_column_is_said(tmp_path: Path) -> None:
    folder = folder_with(tmp_path, {"q_shoulder": "shoulder_pos", "q_elbow": "spare"})
    _, said = describe(folder)
    assert any("no position was found for elbow" in sentence for sentence in said)


def test_the_number_of_a_base_without_a_name_is_no_name(tmp_path: Path) -> None:
    folder = folder_with(tmp_path, {}, pl.lit(1.0).alias("battery_0"))
    on_a_base(folder / "robot.xml", "<freejoint/>")
    _, said = describe(folder)
    assert any(one.startswith("0, caster: a free") for one in said)
    assert not any("if the base moved" in one for one in said)


def on_a_base(model: Path, joint: str) -> None:
    """Put a model on a base that a joint moves."""
    text = model.read_text().replace("<worldbody>", f'<worldbody><body name="base">{joint}{BALL}')
    model.write_text(text.replace("</worldbody>", "</body></worldbody>"))


BALL = '<geom size=".1"/><body><joint name="caster" type="ball"/><geom size=".05"/></body>'


def test_a_pose_without_a_name_is_the_bases_not_of_a_ball_on_it(tmp_path: Path) -> None:
    names = ("x", "y", "z", "qw", "qx", "qy", "qz")
    pose = [pl.lit(float(name == "qw")).alias(name) for name in names]
    folder = folder_with(tmp_path, {}, *pose)
    on_a_base(folder / "robot.xml", '<freejoint name="root"/>')
    (folder / "xmls").mkdir()
    (folder / "robot.xml").rename(folder / "xmls" / "robot.xml")
    path, _ = describe(folder)
    said = yaml.safe_load(path.read_text())
    assert said["model"] == "xmls/robot.xml"
    assert said["measured"]["joint[root].position[3]"]["column"] == "qw"
    assert said["weld"] == ["caster"]


def test_a_folder_without_a_model_or_a_log_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="expected an MJCF or URDF file, one; found none"):
        describe(tmp_path)
    (tmp_path / "robot.xml").write_text(ARM)
    with pytest.raises(ValueError, match="no log"):
        describe(tmp_path)
