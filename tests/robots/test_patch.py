"""The patched MJCF moves as the model with its effects does."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
import yaml

from robotcast.robots.couplings import tendon_arms, tendon_parts
from robotcast.robots.outcome import patched, write_patched
from robotcast.robots.robot_case import RobotCase, read_case
from robotcast.robots.rollout import Rollout
from tests.robots.made_up_robot import ARM, write_folder


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> RobotCase:
    folder = tmp_path_factory.mktemp("arm")
    tune = {"joint[*].damping": {"factor": [0.5, 3.0]}, "body[fore].mass": [0.1, 2.0]}
    tune["actuator[e].kp"] = [1.0, 4.0]
    windows = {"length_s": 0.4, "most": 4}
    more = {"windows": windows, "tune": tune, "servos": {"actuator[e]": {"kp": 2.0, "kd": 0.1}}}
    xml = ARM.replace('name="e"', 'name="e" ctrlrange="-0.05 0.2"')
    cable = '<fixed name="cable"><joint joint="elbow" coef="1"/></fixed>'
    rope = '<joint joint="shoulder" coef="0.5"/><joint joint="elbow" coef="-0.4"/>'
    tendons = f'<tendon>{cable}<fixed name="rope" damping="0.01">{rope}</fixed></tendon>'
    xml = xml.replace("<actuator>", f"{tendons}<actuator>")
    return read_case(write_folder(folder, xml, logs=3, **more))


NATIVE = """dry_friction_elbow drag_shoulder armature_elbow spring_elbow centre_of_mass_fore
inertia_fore tilted_base drive_gain_shoulder servo_stiffness_shoulder torque_limit_shoulder
friction_of_difference_shoulder_and_elbow encoder_offset_shoulder encoder_offset_elbow
command_limit_elbow tendon_friction_tendon_rope tendon_damping_tendon_rope
tendon_stiffness_tendon_rope"""


@pytest.mark.parametrize("name", NATIVE.split())
def test_a_patched_model_moves_as_the_model_with_the_effect(arm: RobotCase, name: str) -> None:
    old, effect = arm.model.rollout, arm.model.effects[name]
    values = {p.name: p.probes[-1] if p.probes else p.nominal for p in effect.parameters}
    spec, left_out = patched(arm.robot, [2.0, 0.7, 3.0], [(effect, values)])
    assert not left_out
    model, plain = spec.compile(), arm.robot.model
    assert model.body("fore").mass[0] == pytest.approx(0.7)
    if name != "inertia_fore":  # as of a body of the same shape
        grown = model.body("fore").inertia / plain.body("fore").inertia
        np.testing.assert_allclose(grown, 0.7 / plain.body("fore").mass[0])
    robot = type(arm.robot)(**{**vars(arm.robot), "model": model, "tune": ()})
    new = Rollout(robot, old.logs, old.windows)
    start, times_s = [1], [arm.model.records[1].times_s]
    vector = np.array([[2.0, 0.7, 3.0, *values.values()]])
    wanted = old.simulate(start, times_s, [effect], vector)
    found = new.simulate(start, times_s, (), np.zeros((1, 0)))
    np.testing.assert_allclose(found, wanted, atol=2e-6)


def test_the_gain_of_a_torque_that_no_actuator_gives_is_left_out(tmp_path: Path) -> None:
    drive = {"joint[axis].torque": {"column": "u_motor"}}
    case = read_case(write_folder(tmp_path, logs=3, drive=drive))
    said = {"effects": ["drive_gain_axis"], "parameters": {"drive_gain_axis.k": {"value": 0.3}}}
    left_out = write_patched(case.robot, case.model.effects, said, tmp_path / "patched.xml")
    assert left_out == ["drive_gain_axis"]


def test_what_mjcf_cannot_hold_is_named(arm: RobotCase, tmp_path: Path) -> None:
    names = ["load_friction_elbow", "dead_time_elbow", "encoder_scale_shoulder"]
    effects = [arm.model.effects[name] for name in names]
    values = {"joint[*].damping": 1.0, "body[fore].mass": 0.5, "actuator[e].kp": 2.0}
    values |= {f"{e.name}.{p.name}": p.probes[-1] for e in effects for p in e.parameters}
    said = {"effects": names, "parameters": {n: {"value": v} for n, v in values.items()}}
    left_out = write_patched(arm.robot, arm.model.effects, said, tmp_path / "patched.xml")
    assert left_out == ["load_friction_elbow", "encoder_scale_shoulder"]
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "patched.xml"))
    assert model.actuator_delay[1] == pytest.approx(values["dead_time_elbow.tau"])


def test_a_link_whose_weight_is_not_compensated_falls_as_in_the_file(tmp_path: Path) -> None:
    xml = ARM.replace('name="fore"', 'name="fore" gravcomp="1"')
    case = read_case(write_folder(tmp_path, xml, logs=2, windows={"length_s": 0.4, "most": 4}))
    effect = case.model.effects["gravity_compensation_fore"]
    others = {"gravity_compensation_every_link", "gravity_compensation_upper"}
    assert not others & {*case.model.effects}  # nothing lifts those
    spec, left_out = patched(case.robot, [], [(effect, {"g": -0.7})])
    fallen = spec.compile()
    assert not left_out and fallen.body_gravcomp.tolist() == [0.0, 0.0, pytest.approx(0.3)]
    rollout, times_s = case.model.rollout, [record.times_s for record in case.model.records]
    own = range(len(times_s)), times_s
    still, falls = rollout.simulate(*own, [effect], np.array([[0.0], [-0.7]]))
    other = Rollout(replace(case.robot, model=fallen), rollout.logs, rollout.windows)
    np.testing.assert_allclose(falls, other.simulate(*own, [], np.zeros((1, 0)))[0], atol=1e-9)
    assert np.abs(falls - still).max() > 0.01


def test_tendons_of_several_joints_have_effects(
    arm: RobotCase,
) -> None:
    found = {n for n in arm.model.effects if n.startswith("tendon_")}
    assert found == {f"tendon_{what}_tendon_rope" for what in ("friction", "damping", "stiffness")}
    units = [arm.model.effects[name].parameters[0].unit for name in sorted(found)]
    assert units == ["N s/m", "N", "N/m"]
    (friction,) = arm.model.effects["tendon_friction_tendon_rope"].parameters
    torque = np.median(arm.sizes.torque / [0.5, 0.4])  # by the arms of the shoulder and the elbow
    assert friction.upper == pytest.approx(2 * torque)


def test_a_cylinder_has_effects_of_its_own_where_its_arm_changes() -> None:
    xml = """<mujoco><worldbody><site name="base" pos="0.2 0 -0.1"/><body>
    <joint name="pin" axis="0 -1 0" range="28.65 68.75" limited="true"/>
    <geom type="capsule" fromto="0 0 0 1 0 0" size="0.03"/><site name="rod" pos="0.4 0 0"/>
    </body></worldbody><tendon>
    <spatial name="cylinder"><site site="base"/><site site="rod"/></spatial>
    <fixed name="rope"><joint joint="pin" coef="0.1"/></fixed>
    </tendon></mujoco>"""
    model = mujoco.MjModel.from_xml_string(xml)
    assert [where.name for where in tendon_parts(model)["tendon"]] == ["tendon_cylinder"]
    rail = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><site name="base" pos="-1 0 0"/><body>
        <joint name="rail" type="slide" axis="1 0 0"/><geom size="0.1"/><site name="rod"/>
        </body></worldbody><tendon>
        <spatial name="cylinder"><site site="base"/><site site="rod"/></spatial>
        </tendon></mujoco>"""
    )
    assert not tendon_parts(rail)["tendon"]  # it is the joint's
    data = mujoco.MjData(model)
    lengths = []
    for angle in np.linspace(0.5, 1.2, 100):  # the file's own pose is beyond its stop
        data.qpos[:] = angle
        mujoco.mj_forward(model, data)
        lengths.append(data.ten_length[0])
    arms = np.diff(lengths) / np.diff(np.linspace(0.5, 1.2, 100))
    assert arms.min() - 1e-3 < tendon_arms(model)[0, 0] < arms.max() + 1e-3


def test_a_tendon_lies_between_its_own_joints_where_one_between_them_is_welded(
    tmp_path: Path,
) -> None:
    wrist = '<body name="wrist"><joint name="lock" axis="0 1 0"/><geom size="0.01" mass="0.1"/>'
    fore = '<body name="fore" pos="0 0 -0.3">'
    xml = ARM.replace(fore, f"{wrist}{fore}").replace(
        "</body></worldbody>", "</body></body></worldbody>"
    )
    said = {"weld": ["lock"], "tune": {"tendon[*].damping": [0.0, 1.0]}}
    rope = '<joint joint="shoulder" coef="0.2"/><joint joint="elbow" coef="0.2"/>'
    tendon = f'<tendon><fixed name="rope" damping="0.01">{rope}</fixed></tendon>'
    folder = write_folder(tmp_path, xml.replace("<actuator>", f"{tendon}<actuator>"), logs=2)
    path = folder / "robot.yaml"
    known = yaml.safe_load(path.read_text()) | said
    del known["measured"]["joint[lock].position"]
    path.write_text(yaml.safe_dump(known))
    case = read_case(folder)
    assert [one.at.rows for one in case.robot.tune] == [(0,)]  # the file's own alone
    assert "friction_of_sum_shoulder_and_elbow" not in case.model.effects  # it is the rope's
    effect = case.model.effects["friction_of_difference_shoulder_and_elbow"]
    spec, left_out = patched(case.robot, [0.02], [(effect, {"friction": 0.7})])
    model = spec.compile()
    assert not left_out and model.ntendon == 2
    assert model.tendon("shoulder-elbow").id == 1
    np.testing.assert_allclose(model.tendon_damping, [0.02, 0.0])
    np.testing.assert_allclose(model.tendon_frictionloss, [0.0, 0.7])
