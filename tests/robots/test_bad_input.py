"""Bad input is refused in one sentence: file, row or joint, rule, and what to do."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
import pytest
import yaml

from robotcast.robots.recordings import tables_of
from robotcast.robots.robot_case import read_case
from robotcast.robots.robot_file import compiled, load_spec
from tests.robots.made_up_robot import SLIDER, rewrite, write_folder

Edit = Callable[[dict], None]


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_folder(tmp_path_factory.mktemp("good"), logs=3)


def copy_of(good: Path, folder: Path, edit: Edit = lambda said: None) -> Path:
    for path in good.iterdir():
        (folder / path.name).write_bytes(path.read_bytes())
    said = yaml.safe_load((good / "robot.yaml").read_text())
    edit(said)
    (folder / "robot.yaml").write_text(yaml.safe_dump(said))
    return folder


def key(*path: str, value: object = None) -> Edit:
    def edit(said: dict) -> None:
        for name in path[:-1]:
            said = said.setdefault(name, {})
        said[path[-1]] = value

    return edit


AXIS = "joint[axis].position"


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (key("measured", AXIS, value="q2"), "log0.csv: robot.yaml takes joint.* 'q2'.* lacks; it"),
        (key("measured", "joint[elbw].position", value="q"), "no joint 'elbw'; it has axis"),
        (key("factors", "heat", value="q2"), "log0.csv: robot.yaml takes factors heat.* 'q2'"),
        (key("factors", value=["q2"]), "factors: expected `key: value` lines"),
        (key("drive", "actuator[m]", value="u"), "no actuator 'm'; it has motor"),
        (key("measured", AXIS, "unit", value="furlong"), "unit 'furlong' is none of m, mm"),
        (key("measured", "joint[axis].angle", value="q"), "expected joint.NAME..position"),
        (key("tune", "joint[axis].damping", value=[3, 9]), "the model's 2 lies outside"),
        (key("tune", "joint[axis].colour", value=[0, 1]), "joint.colour cannot be set; these can"),
        (key("tune", "actuator[motor].kp", value=[1, 9]), "only position servos have a kp"),
        (key("tune", "joint[axis].damping", value=[3]), "expected bounds .least, most."),
        (key("logs", value="run*.csv"), "no file matches 'run"),
        (key("model", value="none.xml"), "there is no such model"),
        (key("colour", value=1), "no key is called 'colour'; there are model"),
        (key("measured", value=None), "'measured' is missing"),
        (lambda said: said.pop("drive"), "'drive' is missing: .*if nothing does, say drive: {}"),
        (key("drive", "actuator[motor]", "unit", value="mA"), "a torque_constant"),
        (key("repeats", value=[["log0.csv", "other.csv"]]), "other.csv is none of the logs"),
        (key("windows", "length_s", value=9.0), "no window of 9 s fits"),
        (key("windows", "length_s", value="long"), "length_s: expected a number"),
        (key("windows", "length_s", value="nan"), "length_s: expected a number"),
        (key("windows", "length", value=1), "no key is called 'length'; there are length_s, most"),
        (key("weld", value=["root"]), "weld: the model has no joint 'root'; it has axis"),
        (key("servos", value={"actuator[motor]": {"kp": 9}}), "actuator.motor.: expected .kp"),
        (key("servos", value={"actuator[a]": {"kp": 9, "kd": 1}}), "a. is none of actuator.motor"),
        (key("payloads", "body[table]", value={"log9.csv": 1}), "log9.csv is none of the logs"),
        (key("payloads", "body[table]", value={"log1.csv": "kg"}), "expected a number, got 'kg'"),
        (key("payloads", "body[table]", value={"log1.csv": {"kg": 1, "at": 5}}), "at: .x, y, z."),
        (key("repeats", value=[[5]]), "repeats: 5 is none of the logs"),
        (key("repeats", value=5), "expected lists of logs, got 5"),
        (key("exclude", value=True), "exclude: expected names, got True"),
        (key("windows", "most", value=-5), "most: expected a number above 0, got -5.0"),
        (key("measured", "joint[axis].position[3]", value="q"), "one number; leave .3. out"),
        (key("tune", "joint[axis].damping[5]", value=[0, 1]), "one number; leave .5. out"),
        (key("sysid", value="none.yaml"), "none.yaml: there is no such file; ParameterDict"),
    ],
)
def test_what_robot_yaml_cannot_say(good: Path, tmp_path: Path, edit: Edit, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        read_case(copy_of(good, tmp_path, edit))


def test_what_a_mocap_body_holds_is_refused(good: Path, tmp_path: Path) -> None:
    held = '<equality><weld body1="hand" body2="table"/></equality></mujoco>'
    text = SLIDER.replace("</mujoco>", held)
    text = text.replace("<worldbody>", '<worldbody><body name="hand" mocap="true"/>')
    folder = copy_of(good, tmp_path)
    (folder / "robot.xml").write_text(text)
    with pytest.raises(ValueError, match="to the mocap body hand, which no log can move; take"):
        read_case(folder)


def stuck(table: pl.DataFrame) -> pl.DataFrame:
    held = pl.int_range(pl.len()).is_between(95, 125)
    return table.with_columns(
        pl.when(held).then(pl.col("q_axis").get(95)).otherwise("q_axis").alias("q_axis")
    )


NOISE = pl.Series("q_axis", np.random.default_rng(0).normal(0, 1e-3, 150))


def saturated(table: pl.DataFrame) -> pl.DataFrame:
    return table.with_columns(pl.col("q_axis").clip(upper_bound=pl.col("q_axis").quantile(0.7)))


def with_cell(column: str, row: int, value: object) -> Callable[[pl.DataFrame], pl.DataFrame]:
    def edit(table: pl.DataFrame) -> pl.DataFrame:
        cells = table[column].to_list()
        cells[row] = value
        return table.with_columns(pl.Series(column, cells, strict=False))

    return edit


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (with_cell("t", 7, 0.0), "log1.csv, line 9: time goes from 0.06 s to 0 s; it must rise"),
        (with_cell("t", 7, None), "log1.csv, line 9: no time"),
        (with_cell("u_motor", 3, None), "line 5: actuator.motor.: no value is commanded"),
        (with_cell("q_axis", 4, "4.0e"), "line 6: q_axis: '4.0e' is no number"),
        (with_cell("q_axis", 20, 90.0), "line 22: joint.axis..position is 90 m, far outside"),
        (lambda table: table.with_columns(q_axis=0.3), "nothing moves in it"),
        (lambda table: table.with_columns(NOISE), "nothing moves in it"),
        (saturated, "a saturated sensor"),
        (stuck, "stays at .* amid a motion, a frozen sensor"),
        (lambda table: table.with_columns(pl.col("t") * 1e3), "a sample every 10 s; no robot is"),
        (lambda table: table.with_columns(pl.col("u_motor") * 9), "where the model clips at -10"),
        (lambda table: table[:20], "20 samples; a log needs at least 50"),
        (lambda table: table.with_columns(pl.col("t") * 3), "logs of one folder need one rate"),
    ],
)
def test_what_a_log_cannot_hold(good: Path, tmp_path: Path, change: Callable, words: str) -> None:
    folder = copy_of(good, tmp_path)
    change(pl.read_csv(folder / "log1.csv")).write_csv(folder / "log1.csv")
    with pytest.raises(ValueError, match=words):
        read_case(folder)


def test_a_joint_that_sticks_and_goes_on_from_where_it_was_is_no_frozen_sensor(
    good: Path, tmp_path: Path
) -> None:
    folder = copy_of(good, tmp_path)
    table = pl.read_csv(folder / "log1.csv")
    q = table["q_axis"].to_numpy()
    steps = np.abs(np.diff(q))
    slow = (steps > 0.4 * np.median(steps)) & (steps < 0.9 * np.median(steps))
    at = 30 + int(np.argmax(slow[30:] & slow[29:-1]))
    rows = np.r_[: at + 1, np.full(25, at), at + 1 : len(q)][: len(q)]
    table.with_columns(pl.Series("q_axis", q[rows])).write_csv(folder / "log1.csv")
    read_case(folder)


FAR = SLIDER.replace(' range="-3 3"', "")
WILD = SLIDER.replace('damping="2"', 'damping="2" stiffness="1e9"').replace("implicitfast", "Euler")
MESH = SLIDER.replace("<worldbody>", '<asset><mesh file="hand.stl"/></asset><worldbody>')


@pytest.mark.parametrize(
    ("xml", "factor", "words"),
    [
        (FAR, 100, "is .* m, and it comes back; is"),
        (WILD, 1, "the model diverges in"),
        (MESH, 1, "Error opening file 'hand.stl'; copy its meshes along"),
    ],
)
def test_what_a_model_cannot_be(
    good: Path, tmp_path: Path, xml: str, factor: float, words: str
) -> None:
    folder = rewrite(copy_of(good, tmp_path), pl.col("q_axis") * factor)
    (folder / "robot.xml").write_text(xml)
    with pytest.raises(ValueError, match=words):
        read_case(folder)


def as_semicolons(text: str) -> str:
    return text.replace(",", ";").replace(".", ",")


@pytest.mark.parametrize(
    "write",
    [
        as_semicolons,
        lambda text: f"# {text}",
        lambda text: f"# a pendulum, of 2022\n#\n\n{text}",
        lambda text: f"# made at noon\n# {text}",
        lambda text: text.replace(",", ", "),
    ],
)
def test_tables_as_loggers_write_them_are_read_alike(
    good: Path, tmp_path: Path, write: Callable[[str], str]
) -> None:
    path = tmp_path / "log.csv"
    path.write_text("\ufeff" + write((good / "log0.csv").read_text()), encoding="utf-8")
    assert tables_of(path)[0][1].equals(tables_of(good / "log0.csv")[0][1])


@pytest.mark.parametrize("row", ["0.0,0.1,", "0.0,nan,auto", "2026-01-01T00:00:00,0.1,0.2"])
def test_a_header_behind_a_mark_is_one_whatever_is_below(tmp_path: Path, row: str) -> None:
    path = tmp_path / "log.csv"
    path.write_text(f"# a rig\n# t,q,dq\n{row}\n1.0,0.2,0.3\n", encoding="utf-8")
    assert tables_of(path)[0][1].columns == ["t", "q", "dq"]


def test_a_row_is_called_by_its_line_below_remarks(good: Path, tmp_path: Path) -> None:
    folder = copy_of(good, tmp_path)
    table = with_cell("u_motor", 3, None)(pl.read_csv(folder / "log1.csv"))
    (folder / "log1.csv").write_text(f"# a rig\n#\n{table.write_csv()}", encoding="utf-8")
    with pytest.raises(ValueError, match=r"line 7: actuator.motor.: no value is commanded"):
        read_case(folder)


def test_an_angle_runs_on_where_its_encoder_wraps(tmp_path: Path) -> None:
    turns = SLIDER.replace('type="slide" axis="1 0 0"', 'axis="0 0 1"').replace('range="-3 3"', "")
    turns = turns.replace('damping="2"', 'damping="0.02"')
    folder = write_folder(tmp_path, turns)
    on = [log.measured for log in read_case(folder).logs]
    assert max(np.ptp(one) for one in on) > np.pi
    wrapped = (pl.col("q_axis") + np.pi).mod(2 * np.pi) - np.pi
    gaps = pl.when(pl.int_range(pl.len()) % 3 > 0).then(wrapped)  # not every row has a sample
    case = read_case(rewrite(folder, gaps.alias("q_axis")))
    assert "most in log0.csv: 33 % of axis" in " ".join(case.notes)
    again = [log.measured for log in case.logs]
    for one, other in zip(on, again, strict=True):
        apart = (other - one)[np.isfinite(other)]
        np.testing.assert_allclose(apart, apart[0], atol=1e-9)


def test_a_servo_follows_an_angle_that_runs_on(tmp_path: Path) -> None:
    turns = SLIDER.replace('type="slide" axis="1 0 0"', 'axis="0 0 1"').replace('range="-3 3"', "")
    servo = '<position name="motor" joint="axis" kp="200" kv="20"/></actuator>'
    turns = turns.partition("<motor")[0] + servo + turns.partition("</actuator>")[2]
    folder = write_folder(tmp_path, turns)
    plain = read_case(folder)
    both = [((pl.col(c) - 0.1).mod(2 * np.pi) + 0.1).alias(c) for c in ("q_axis", "u_motor")]
    again = read_case(rewrite(folder, *both))
    for one, other in zip(plain.logs, again.logs, strict=True):
        np.testing.assert_allclose(
            one.drive - one.measured, other.drive - other.measured, atol=1e-9
        )


def test_meshes_of_a_ros_package_are_found_beside_the_file(tmp_path: Path) -> None:
    urdf = tmp_path / "arm.urdf"
    mesh = '<mesh filename="package://arm_description/meshes/link.stl"/>'
    inertia = '<mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    urdf.write_text(
        f'<robot name="arm"><link name="base"/><link name="link"><inertial>{inertia}</inertial>'
        f'<collision><geometry>{mesh}</geometry></collision></link><joint name="j" '
        'type="continuous"><parent link="base"/><child link="link"/></joint></robot>',
        encoding="utf-8",
    )
    with pytest.raises(ValueError, match=r"there is no mesh package.*copy the folder arm_descr"):
        load_spec(urdf)
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
    faces = np.zeros(4, [("corners", np.float32, (4, 3)), ("end", np.uint16)])
    faces["corners"][:, 1:] = corners[[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]]
    folder = tmp_path / "arm_description" / "meshes"
    folder.mkdir(parents=True)
    stl = bytes(80) + np.uint32(4).tobytes() + faces.tobytes()
    (folder / "link.stl").write_bytes(stl)
    assert compiled(load_spec(urdf), urdf).nmesh == 1


def test_a_table_without_a_header_is_refused(good: Path, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text((good / "log0.csv").read_text().partition("\n")[2])
    with pytest.raises(ValueError, match="line 1: numbers where the names"):
        tables_of(path)


def test_units_are_converted_once(good: Path, tmp_path: Path) -> None:
    in_mm = key("measured", AXIS, value={"column": "q_axis", "unit": "mm"})
    folder = rewrite(copy_of(good, tmp_path, in_mm), pl.col("q_axis") * 1000)
    same, converted = read_case(good), read_case(folder)
    for one, other in zip(same.model.records, converted.model.records, strict=True):
        np.testing.assert_allclose(one.measured, other.measured, rtol=1e-9)
