"""Bodies that move freely: how quaternions turn, and a thrown box beside a slider."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import polars as pl
import pytest
import yaml

from robotcast.diagnosis.rule import Effort, Rule
from robotcast.robots.by_joint import diagnose_by_joint
from robotcast.robots.describe import describe
from robotcast.robots.names import (
    moved,
    quaternions,
    rate_of_turn,
    rates,
    spin,
    turn,
    turned,
)
from robotcast.robots.robot_case import RobotCase, read_case

BOX = """<mujoco><option timestep="0.004" integrator="implicitfast"/><worldbody>
<body name="box" pos="0 0 1"><freejoint name="root"/>
<inertial pos="0 0 0" mass="0.3" diaginertia="4e-4 6e-4 9e-4"/></body>{}</worldbody></mujoco>"""
SLIDER = """<body name="table"><joint name="axis" type="slide" axis="1 0 0" stiffness="40"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>"""
BALL = '<body><joint type="ball"/><geom size="1"/><body><joint/><geom size="1"/></body></body>'
POSE = ["x", "y", "z", "qw", "qx", "qy", "qz"]
PERIOD_S, LATE = 0.004, 5  # samples


def throw(
    folder: Path, more: str = "", drag: float = 0.0, push: Sequence[float] = (0,) * 3, late: int = 0
) -> Path:
    """Write a model and logs of throws; quaternions have any sign, and poses may show late."""
    xml = BOX.format(more)
    (folder / "box.xml").write_text(xml)
    model = mujoco.MjModel.from_xml_string(xml)
    model.opt.timestep = PERIOD_S / 10
    for n in range(12):
        rng, data, rows = np.random.default_rng(n), mujoco.MjData(model), []
        turned = rng.normal(size=4)
        data.qpos[3:7] = turned / np.linalg.norm(turned)
        data.qpos[7:] = 0.1
        data.qvel[:6] = [*rng.uniform([-2, -2, 3], [2, 2, 5]), *rng.uniform(-8, 8, 3)]
        for _ in range(180):
            place = data.qpos[:3] + 3e-4 * rng.normal(size=3)
            turned = data.qpos[3:7] + 4e-4 * rng.normal(size=4)
            sign = rng.choice([-1, 1])
            rows.append([*place, *(sign * turned), *(data.qpos[7:] + 1e-4 * rng.normal())])
            for _ in range(10):
                data.qfrc_applied[:3] = push - drag * data.qvel[:3]
                mujoco.mj_step(model, data)
        seen = np.array(rows)[late:]
        seen[:, :7] = np.array(rows)[: len(seen), :7]
        columns = dict(zip([*POSE, "axis"], seen.T, strict=False))
        t = PERIOD_S * np.arange(len(seen))
        pl.DataFrame({"t": t, **columns}).write_csv(folder / f"log{n:02d}.csv")
    describe(folder)
    return folder


@pytest.fixture(scope="module")
def late(tmp_path_factory: pytest.TempPathFactory) -> RobotCase:
    return read_case(throw(tmp_path_factory.mktemp("late"), SLIDER, late=LATE))


def test_coordinates_move_as_mujocos_do() -> None:
    model = mujoco.MjModel.from_xml_string(BOX.format(BALL))
    rng = np.random.default_rng(0)
    qpos, by = rng.normal(size=(5, model.nq)), rng.normal(size=(5, model.nv))
    for at, _ in quaternions(model):
        qpos[:, at : at + 4] /= np.linalg.norm(qpos[:, at : at + 4], axis=1, keepdims=True)
    found = moved(model, qpos, by)
    for start, step, end in zip(qpos, by, found, strict=True):
        own, back = start.copy(), np.empty(model.nv)
        mujoco.mj_integratePos(model, own, step, 1.0)
        np.testing.assert_allclose(end, own, atol=1e-12)
        mujoco.mj_differentiatePos(model, back, 1.0, start, end)
        np.testing.assert_allclose(back, step, atol=1e-12)
        for at, dof in quaternions(model):
            here, there = start[at : at + 4], -end[at : at + 4]
            np.testing.assert_allclose(turn(here, there), step[dof : dof + 3], atol=1e-12)
    turned_by, spinning, q = 0.2 * rng.normal(size=3), rng.normal(size=3), np.array([1.0, 0, 0, 0])
    rate = rate_of_turn(turned_by, spinning)
    there = [turned(q, turned_by + s * 1e-6 * rate) for s in (-1, 1)]
    np.testing.assert_allclose(turn(*there) / 2e-6, spinning, atol=2e-4)
    np.testing.assert_allclose(spin(turned_by, rate), spinning, atol=2e-4)
    path = np.array(
        [
            [moved(model, one[None], s * 1e-4 * v[None])[0] for s in range(3)]
            for one, v in zip(qpos, by, strict=True)
        ]
    )
    np.testing.assert_allclose(rates(model, path, 1e-4)[:, 1], by, atol=1e-5)


@pytest.mark.parametrize(
    ("acts", "name", "parameter", "size"),
    [
        ({"drag": 0.06}, "viscous_friction_root_path", "damping", 0.06),
        ({"push": (0.25, 0.0, -0.1)}, "constant_force_root_path", "x", 0.25),
    ],
)
def test_what_acts_on_a_thrown_box_is_named_where_nothing_drives_it(
    tmp_path: Path, acts: dict[str, Any], name: str, parameter: str, size: float
) -> None:
    case = read_case(throw(tmp_path, **acts))
    found = diagnose_by_joint(case, case.question((), (), Rule(), Effort()), lambda _: None)
    assert found["verdict"] == [name]
    given = found["model"]["parameters"][f"{name}.{parameter}"]
    assert given["low"] < size < given["high"]
    assert found["ladder"][-1]["heldout_typical_error_percent"] < 1.5 * case.floor.percent
    assert not found["next_actions"]


def test_a_model_that_is_far_off_does_not_say_where_bodies_started(tmp_path: Path) -> None:
    for name, drag in (("right", 0.0), ("lacking", 0.2)):
        (tmp_path / name).mkdir()
        model = read_case(throw(tmp_path / name, drag=drag)).model
        assert model.is_led == (drag == 0.0)


def test_a_pose_that_shows_late_is_predicted(late: RobotCase) -> None:
    model, tau = late.model, LATE * PERIOD_S
    path = model.predict(model.records, ["encoder_latency_root"], np.array([[tau]]))[0]
    assert model.usual_miss(model.misses(path)) < 1.2 * late.floor.percent


@pytest.mark.parametrize(
    ("target", "column", "words"),
    [
        ("position[6]", None, r"no column measures joint.root..position.6., .* say weld: .root."),
        ("position[3]", "x", "the quaternion has the length"),
        ("position", "x", r"end it with .0. to .6.: x y z .m., then the quaternion w x y z"),
        ("velocity[3]", "spin", r"root..velocity.3. does not go with the pose"),
    ],
)
def test_a_pose_that_cannot_be(
    late: RobotCase, tmp_path: Path, target: str, column: str | None, words: str
) -> None:
    said = yaml.safe_load(late.robot.path.read_text())
    measured = said["measured"] | {f"joint[root].{target}": column}
    said["measured"] = {k: v for k, v in measured.items() if v is not None}
    for path in late.robot.path.parent.glob("*.*"):
        (tmp_path / path.name).write_text(path.read_text())
    for path in tmp_path.glob("*.csv"):  # a gyroscope that shows another turn
        pl.read_csv(path).with_columns(spin=(40 * pl.col("t")).sin()).write_csv(path)
    (tmp_path / "robot.yaml").write_text(yaml.safe_dump(said, sort_keys=False))
    with pytest.raises(ValueError, match=words):
        read_case(tmp_path)
