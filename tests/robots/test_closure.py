"""Closed chains and coupled joints: where joints without an encoder stand, and what drives move."""

from pathlib import Path

import mujoco
import numpy as np
import polars as pl
import pytest
from mujoco.batch import Batch

from robotcast.fitting.parameter import Parameter
from robotcast.robots.closure import Followers, equalities
from robotcast.robots.describe import describe
from robotcast.robots.effect import Where
from robotcast.robots.robot_case import read_case
from robotcast.robots.sizes import dynamics
from robotcast.robots.transmission import ElasticJoint, Transmission, link_inertia
from tests.robots.made_up_robot import write_folder

LINKAGE = """
<mujoco><option timestep="0.005" integrator="implicitfast"/><compiler angle="radian"/>
<default><geom type="capsule" size="0.01" contype="0" conaffinity="0"/></default><worldbody>
<body name="crank"><joint name="crank" axis="0 1 0" damping="0.02" armature="0.002"/>
<geom fromto="0 0 0 0.1 0 0" mass="0.2"/>
<body name="coupler" pos="0.1 0 0"><joint name="pin" axis="0 1 0"/>
<geom fromto="0 0 0 0.25 0 0.16" mass="0.1"/></body></body>
<body name="rocker" pos="0.3 0 0"><joint name="rocker" axis="0 1 0"/>
<geom fromto="0 0 0 0.05 0 0.16" mass="0.2"/></body></worldbody>
<equality><connect body1="coupler" body2="rocker" anchor="0.25 0 0.16"/></equality>
<actuator><motor name="motor" joint="crank" gear="0.08"/></actuator></mujoco>"""
CRANK = {"joint[crank].position": {"column": "q_crank"}}
RACKS = """
<mujoco><worldbody>
<body name="left"><joint name="left" type="slide" axis="1 0 0" armature="0.1"/>
<inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body>
<body name="right"><joint name="right" type="slide" axis="1 0 0"/>
<inertial pos="0 0 0" mass="3" diaginertia="1 1 1"/></body></worldbody>
<equality><joint joint1="right" joint2="left" polycoef="0 -2 0 0 0"
solimp="0.9999 0.9999 0.001"/></equality></mujoco>"""


def test_passive_joints_stand_where_the_chain_is_closed() -> None:
    """At any angle of a crank that turns all round, on one branch, and as fast as it takes."""
    model = mujoco.MjModel.from_xml_string(LINKAGE)
    data, followers, step = mujoco.MjData(model), Followers(model, {0}), 1e-6
    assert followers.dofs.tolist() == [1, 2] and not followers.lacking
    for angle in (0.0, 1.0, 4.0, -9.0):
        near = []
        for turned in (angle, angle + step):
            qpos, qvel = np.array([turned, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])
            followers.settle(qpos, qvel)
            data.qpos[:] = qpos
            mujoco.mj_fwdPosition(model, data)
            assert np.abs(equalities(model, data)[2]).max() < 1e-9
            near.append(qpos)
        np.testing.assert_allclose((near[1] - near[0]) / step, qvel, rtol=1e-4)
        rocker = data.body("rocker").xmat.reshape(3, 3) @ [0.05, 0.0, 0.16]
        assert rocker[2] > 0  # it never turns over
    short = mujoco.MjModel.from_xml_string(LINKAGE.replace("0.3 0 0", "0.45 0 0"))
    qpos = np.array([3.0, 0.0, 0.0])
    assert not Followers(short, {0}).settle(qpos, np.zeros(3))  # it cannot reach


def test_only_the_crank_of_a_chain_need_be_measured(tmp_path: Path) -> None:
    case = read_case(write_folder(tmp_path, LINKAGE, measured=CRANK))
    assert case.model.usual_miss(case.model.nominal_misses) < 2 * case.floor.percent
    assert "dry_friction_rocker" in case.model.effects  # it acts, though nobody sees it alone
    assert not {"encoder_offset_rocker", "encoder_latency_pin"} & {*case.model.effects}
    (tmp_path / "robot.yaml").unlink()
    for path in tmp_path.glob("log*.csv"):
        pl.read_csv(path).drop("q_pin", "q_rocker").write_csv(path)
    assert "pin and rocker stand follows" in " ".join(describe(tmp_path)[1])
    free = LINKAGE.partition("<equality>")[0] + "</mujoco>"
    with pytest.raises(ValueError, match=r"no column measures joint\[pin\].position"):
        read_case(write_folder(tmp_path / "free", free.replace("<actuator>", ""), measured=CRANK))


def test_a_tied_joint_moves_what_it_is_tied_to(tmp_path: Path) -> None:
    """Torques and inertia of it are those of all that moves, whatever holds it together."""
    model = mujoco.MjModel.from_xml_string(RACKS)
    assert link_inertia(model, [0])[0] == pytest.approx(2 + 4 * 3, rel=0.02)  # all but its rotor
    case = read_case(write_folder(tmp_path, LINKAGE, noise=0.0))
    own = dynamics(case.robot, case.logs, case.starts)
    left = np.median(np.abs(own.missing[:, 0])) / np.median(np.abs(own.given[:, 0]))
    assert left < 0.1  # what drives the crank is what its motion needs


def test_a_link_is_where_the_encoder_of_a_tied_joint_says() -> None:
    model = mujoco.MjModel.from_xml_string(RACKS)
    spring = [Parameter("c", "m/N", 0.0, 0.1, 0.0, null=0.0)]
    elastic, other = (
        ElasticJoint("elastic", "", spring, Where("", (dof,), (1 + dof,), (), ())) for dof in (0, 1)
    )
    own, null = ({"c": np.array([[c]]), "retardation": np.array([[0.0]])} for c in (1e-3, 0.0))
    batch = Batch(model, 1, nthread=1)
    qpos, qvel = batch.bind("qpos"), batch.bind("qvel")
    qpos[:], qvel[:] = [[0.10, -0.16]], [[1.0, -1.8]]
    between = Transmission(batch, [(elastic, own), (other, null)])  # at its null, an effect is none
    between.place(np.zeros((1, 2, 2)))
    np.testing.assert_allclose(qpos, [[0.08, -0.16]], atol=1e-12)
    np.testing.assert_allclose(qvel, [[0.9, -1.8]], atol=1e-12)
    seen, rate = qpos.copy(), qvel.copy()
    between.show(seen, rate)
    np.testing.assert_allclose([seen[0, 0], rate[0, 0]], [0.10, 1.0])
