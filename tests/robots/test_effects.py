"""What effects of robots do, against what they say."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import polars as pl
import pytest

from robotcast.diagnosis.rule import Effort, Rule
from robotcast.fitting.parameter import Parameter
from robotcast.robots.by_joint import diagnose_by_joint
from robotcast.robots.effect import Motion, Where
from robotcast.robots.effects import (
    CommandRate,
    Encoder,
    EncoderOffset,
    EncoderScale,
    SpeedLimit,
    Stribeck,
)
from robotcast.robots.library import alone, candidates, parts_of
from robotcast.robots.model_fields import OneModel, Payload, load
from robotcast.robots.outcome import write_patched
from robotcast.robots.robot_case import RobotCase, read_case
from tests.robots.made_up_robot import ARM, PERIOD_S, diagnosed, rewrite, write_folder

WHERE = Where("axis", (0,), (1,), (0,), (0,))
LEGS = "".join(
    f"""<body name="{side}_thigh" pos="{k} 0 0"><joint name="{side}_hip_joint" axis="0 1 0"/>
<inertial pos="0 0 -0.1" mass="1" diaginertia="0.01 0.01 0.01"/>
<body name="{side}_shank" pos="0 0 -0.2"><joint name="{side}_knee_joint" axis="0 1 0"/>
<inertial pos="0 0 -0.1" mass="1" diaginertia="0.01 0.01 0.01"/><body name="{side}_foot"/>
</body></body>"""
    for k, side in enumerate(("left", "right", "third"))
)
WALKER = f"""<mujoco><option timestep="0.005"/><worldbody>{LEGS}</worldbody><actuator>
<motor name="left" joint="left_knee_joint"/><motor name="right" joint="right_knee_joint"/>
</actuator></mujoco>"""

SERVO = """<mujoco><worldbody><body><joint name="axis" axis="0 0 1" damping="0.1"/>
<inertial pos="0 0 0" mass="1" diaginertia="0.1 0.1 0.1"/></body></worldbody><actuator>
<position joint="axis" kp="5" kv="0.5" gear="2"/><motor joint="axis"/>
<velocity joint="axis" kv="0"/></actuator></mujoco>"""


def parameters(*names: str) -> list[Parameter]:
    return [Parameter(name, "1", 0.0, 10.0, 0.0, null=0.0) for name in names]


LINKS = "".join(
    f"""<body pos="0 0 -0.2"><joint name="j.{k}" axis="{k % 2} {1 - k % 2} 0" damping="0.02"/>
<inertial pos="0 0 -0.1" mass="0.5" diaginertia="0.002 0.002 0.001"/>"""
    for k in range(5)
)
SERVOS = "".join(f'<position name="s{k}" joint="j.{k}" kp="8" kv="0.6"/>' for k in range(5))
CHAIN = f"""<mujoco><option timestep="0.001" integrator="implicitfast"/><worldbody>{LINKS}
</body></body></body></body></body></worldbody><actuator>{SERVOS}</actuator></mujoco>"""


LATE = 2  # rows


@pytest.mark.parametrize(
    ("effect", "logged", "size"),
    [
        ("encoder_latency_elbow", pl.col("q_elbow").shift(LATE), LATE * PERIOD_S),
        ("early_command", pl.col("u_s", "u_e").shift(LATE), LATE * PERIOD_S),
        ("clock", pl.col("t") * 1.05, 0.05),
    ],
)
def test_late_columns_and_a_wrong_clock_are_undone(
    tmp_path: Path, effect: str, logged: pl.Expr, size: float
) -> None:
    windows = {"length_s": 0.4, "most": 6}
    folder = write_folder(tmp_path, ARM, logs=3, windows=windows, noise=0.0, finer=1)
    model = read_case(rewrite(folder, logged.fill_null(strategy="backward"))).model
    found = model.predict(model.records, [effect], np.array([[0.0], [size]]))
    off = [
        [np.linalg.norm(one[: len(r.times_s)] - r.measured) for one in found[:, k]]
        for k, r in enumerate(model.records)
    ]
    without, with_it = np.median(off, axis=0)
    assert with_it < without / 4


def test_a_servo_follows_a_step_no_faster_than_its_rate() -> None:
    effect = CommandRate("rate", "", parameters("s"), WHERE)
    step = np.ones((2, 100, 1))
    step[:, :10] = 0.0
    s = np.array([[0.0], [0.5]])
    found = effect.command(step, 0.01, s=s[:, :, None])
    assert (found[0] == step[0]).all()
    np.testing.assert_allclose(np.diff(found[1, 10:59, 0]), 2.0 * 0.01)
    assert found[1, -1, 0] == 1.0


@pytest.mark.parametrize(
    ("effect", "values"),
    [
        (EncoderOffset("offset", "", parameters("q0"), WHERE), {"q0": 0.2}),
        (EncoderScale("scale", "", parameters("k"), WHERE), {"k": -0.3}),
    ],
)
def test_a_servo_brings_to_its_command_what_the_encoder_shows(
    effect: Encoder, values: dict[str, float]
) -> None:
    model = mujoco.MjModel.from_xml_string(SERVO)
    before, own = model.actuator_biasprm.copy(), {n: np.array([[v]]) for n, v in values.items()}
    effect.closes(model, model.actuator_biasprm[None], **{name: 0 * v for name, v in own.items()})
    assert (model.actuator_biasprm == before).all()
    effect.closes(model, model.actuator_biasprm[None], **own)
    assert (model.actuator_biasprm[1:] == before[1:]).all()
    data = mujoco.MjData(model)
    data.ctrl[0] = 2 * 0.6  # through the gear
    mujoco.mj_step(model, data, 2000)
    assert effect.seen(data.qpos[None], **own)[0, 0] == pytest.approx(0.6, abs=1e-4)


def test_a_drive_pushes_no_faster_than_its_speed_but_brakes_from_any() -> None:
    effect = SpeedLimit("limit", "", parameters("s"), WHERE)
    speed = np.array([[0.5], [1.0], [2.0], [2.0]])
    torque = np.array([[3.0], [3.0], [3.0], [-3.0]])
    motion = Motion({}, np.zeros((4, 1)), speed, speed, torque)
    left = torque + effect.force(motion, s=np.ones((4, 1)))
    np.testing.assert_allclose(left[:, 0], [3.0, 0.0, 0.0, -3.0], atol=1e-12)


def test_stribeck_friction_falls_from_its_peak_to_dry_friction() -> None:
    effect = Stribeck("stribeck", "", parameters("torque", "peak", "speed"), WHERE)
    speed = np.array([[0.0, 0.1, 5.0]])
    motion = Motion({}, np.zeros((1, 1)), speed, speed, speed)
    one = {name: np.array([[v]]) for name, v in (("torque", 2.0), ("peak", 1.0), ("speed", 0.1))}
    found = effect.friction(motion, **one)
    np.testing.assert_allclose(found[0], [3.0, 2 + np.exp(-1), 2.0])


def test_joints_that_are_alike_share_effects_until_one_is_named(tmp_path: Path) -> None:
    windows = {"length_s": 0.3, "most": 4}
    case = read_case(write_folder(tmp_path, WALKER, logs=1, windows=windows))
    shanks = [where.name for where in parts_of(case.robot)["body"]]  # their feet do not move
    assert shanks == ["left_shank", "right_shank", "third_shank"]
    parts = {where.name: where.dofs for where in parts_of(case.robot)["joint"]}
    assert parts == {"hip_joint": (0, 2, 4), "knee_joint": (1, 3, 5)}
    legs = "left_{0}, right_{0}, third_{0}".format
    assert f"hip joint ({legs('hip_joint')}); knee joint ({legs('knee_joint')})" in case.notes[1]
    whole = case.model.effects["dry_friction_knee_joint"]
    single = {e.name: e for e in candidates(case.robot, case.sizes, alone(case.robot))}
    assert [name for name, one in single.items() if one.is_part_of(whole)] == [
        f"dry_friction_{side}_knee_joint" for side in ("left", "right", "third")
    ]
    assert not whole.is_part_of(single["dry_friction_left_knee_joint"])
    assert "elastic_joint_knee_joint" not in case.model.effects  # one has no drive


def test_a_joint_is_told_apart_within_its_group(tmp_path: Path) -> None:
    def hide(model: mujoco.MjModel) -> None:
        model.dof_frictionloss[3] = 0.1  # right_knee_joint

    windows = {"length_s": 0.5, "most": 12}
    case = read_case(write_folder(tmp_path, WALKER, logs=8, windows=windows, change=hide))
    kept = ("viscous_friction_knee_joint", "dry_friction_knee_joint")
    others = [n for n, e in case.model.effects.items() if e.depends_on is None and n not in kept]
    effort = Effort(some=12, tried=3, finalists=1)
    found = diagnose_by_joint(case, case.question(others, (), Rule(), effort), lambda known: None)
    assert found["verdict"] == ["dry_friction_right_knee_joint"]
    torque = found["model"]["parameters"]["dry_friction_right_knee_joint.torque"]
    assert torque["value"] == pytest.approx(0.1, rel=0.1)
    assert "told apart" in found["notes"][0]


@pytest.mark.parametrize(
    ("frictions", "name"),
    [
        ((0.3, 0.1, 0.2, 0.05, 0.15), "each_hinge"),
        ((0.3, 0.0, 0.2, 0.0, 0.0), "j.0_and_j.2"),
        ((0.1,) * 5, "all_hinges"),
    ],
)
def test_joints_of_a_chain_have_friction_of_another_size_each(
    tmp_path: Path, frictions: tuple[float, ...], name: str
) -> None:
    def hide(model: mujoco.MjModel) -> None:
        model.dof_frictionloss[:] = frictions

    windows = {"length_s": 0.5, "most": 16}
    case = read_case(write_folder(tmp_path, CHAIN, windows=windows, change=hide))
    kept = ("dry_friction_each_hinge", "dry_friction_all_hinges", "viscous_friction_all_hinges")
    others = [n for n, e in case.model.effects.items() if e.depends_on is None and n not in kept]
    effort = Effort(some=16, tried=3, finalists=1)
    found = diagnose_by_joint(case, case.question(others, (), Rule(), effort), lambda known: None)
    effect = f"dry_friction_{name.replace('.', '_')}"
    assert found["verdict"] == [effect]
    again = read_case(tmp_path).question([], [effect], Rule(), effort)
    assert again.fixed == (effect,) and effect in again.model.effects
    sizes = [p["value"] for p in found["model"]["parameters"].values()]
    true = list(dict.fromkeys(f for f in frictions if f))
    np.testing.assert_allclose(sizes, true, atol=0.015)
    write_patched(case.robot, case.model.effects, found["model"], tmp_path / "new.xml")
    new = mujoco.MjModel.from_xml_path(str(tmp_path / "new.xml"))
    np.testing.assert_allclose(new.dof_frictionloss, frictions, atol=0.015)


@pytest.mark.parametrize(
    ("tuned", "left"),
    [
        ("joint[j.1].frictionloss", {"all_hinges": (0, 1, 2, 3, 4), "each_hinge": (0, 2, 3, 4)}),
        ("joint[*].frictionloss", {"each_hinge": (0, 1, 2, 3, 4)}),
    ],
)
def test_what_is_tuned_is_no_candidate(
    tmp_path: Path, tuned: str, left: dict[str, tuple[int, ...]]
) -> None:
    windows, tune = {"length_s": 0.5, "most": 16}, {tuned: [0.0, 1.0]}
    case = read_case(write_folder(tmp_path, CHAIN, logs=2, windows=windows, tune=tune))
    dry = {n.removeprefix("dry_friction_"): e for n, e in case.model.effects.items()}
    assert {n: dry[n].where.dofs for n in ("all_hinges", "each_hinge") if n in dry} == left


def test_one_signal_beyond_its_floor_is_not_lost_among_many_at_theirs(tmp_path: Path) -> None:
    def hidden(torque: float) -> RobotCase:
        def hide(model: mujoco.MjModel) -> None:
            model.dof_frictionloss[3] = torque  # right_knee_joint

        windows = {"length_s": 0.5, "most": 24}
        folder = tmp_path / f"{torque}"
        return read_case(
            write_folder(folder, WALKER, logs=12, windows=windows, change=hide, noise=2e-3)
        )

    def by_joint(case: RobotCase) -> dict[str, Any]:
        kept = ("viscous_friction_knee_joint", "dry_friction_knee_joint")
        every = case.model.effects | case.of_single_parts
        laws = [n for n in case.model.effects if every[n].depends_on is None and n not in kept]
        laws += [
            n for n, e in case.of_single_parts.items() if e.part == "body"
        ]  # so weak, they fit
        effort = Effort(some=12, tried=3, finalists=1)
        return diagnose_by_joint(case, case.question(laws, (), Rule(), effort), lambda known: None)

    found = by_joint(hidden(0.009))
    assert found["verdict"] == ["dry_friction_right_knee_joint"]
    assert "right knee joint position at 4.5 times what noise leaves" in found["notes"][0]
    weak = by_joint(hidden(0.004))  # all signals together stand within 1.5 times their floor
    assert weak["verdict"] == ["none"] and weak["unexplained"]
    assert weak["sentence"].endswith(
        "But right knee joint position is at 1.9 times what noise leaves."
    )
    perfect = by_joint(hidden(0.0))
    assert perfect["verdict"] == ["none"] and not perfect["unexplained"]


def test_what_one_link_lacks_is_named_beside_what_a_group_lacks(tmp_path: Path) -> None:
    def hide(model: mujoco.MjModel) -> None:
        model.dof_damping[1::2] += 0.05  # of all knees
        thigh = model.body("left_thigh").id
        model.body_mass[thigh] *= 2.5
        model.body_inertia[thigh] *= 2.5

    windows = {"length_s": 0.5, "most": 12}
    case = read_case(write_folder(tmp_path, WALKER, logs=12, windows=windows, change=hide))
    kept = "viscous_friction_knee_joint"
    others = [n for n, e in case.model.effects.items() if e.depends_on is None and n != kept]
    effort = Effort(some=12, tried=3, finalists=1)
    found = diagnose_by_joint(case, case.question(others, (), Rule(), effort), lambda known: None)
    assert {*found["verdict"]} == {kept, "mass_left_thigh"}
    mass = found["model"]["parameters"]["mass_left_thigh.k"]
    assert mass["value"] == pytest.approx(1.5, abs=0.1)


def test_a_payload_beside_the_centre_of_a_light_link_is_one_effect(tmp_path: Path) -> None:
    def hide(model: mujoco.MjModel) -> None:
        on_fore = Payload(model.body("fore").id, 0.4, (0, 0, -0.264))  # of 0.05 kg, with 0.12 m
        load([[on_fore]], OneModel(model))
        mujoco.mj_setConst(model, mujoco.MjData(model))

    xml = ARM.replace('mass="0.5" diaginertia="0.003 0.003', 'mass="0.05" diaginertia="3e-4 3e-4')
    case = read_case(write_folder(tmp_path, xml, change=hide))
    of_the_link = ["mass_fore", "centre_of_mass_fore", "payload_fore", "inertia_fore"]
    found = diagnosed(case, *of_the_link, "viscous_friction_elbow", "armature_elbow")
    assert found["verdict"] == ["payload_fore"]
    sizes = found["model"]["parameters"]
    assert sizes["payload_fore.k"]["value"] == pytest.approx(8.0, rel=0.05)
    assert sizes["payload_fore.z"]["value"] == pytest.approx(-0.128, rel=0.1)


def test_a_payload_has_the_inertia_of_where_it_must_be(tmp_path: Path) -> None:
    case = read_case(write_folder(tmp_path, ARM, logs=1))
    effect, place = case.model.effects["payload_fore"], np.array([0.03, -0.02, -0.2])
    spec = mujoco.MjSpec.from_string(ARM)
    hung = {"mass": 0.3, "ipos": [0, 0, 0], "inertia": [1e-12] * 3, "explicitinertial": True}
    spec.body("fore").add_body(pos=place, **hung)
    ours = OneModel(mujoco.MjModel.from_xml_string(ARM))
    shift = 0.3 / 0.8 * (place - ours.model.body("fore").ipos)
    moves = {axis: np.array([[m]]) for axis, m in zip("xyz", shift, strict=True)}
    effect.write(ours, k=np.array([[0.3 / 0.5]]), **moves)
    mujoco.mj_setConst(ours.model, mujoco.MjData(ours.model))
    inertia = []
    for model in (spec.compile(), ours.model):
        data, mass = mujoco.MjData(model), np.empty((2, 2))
        data.qpos[:] = 0.4, -0.9
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, mass)
        inertia.append([*mass.ravel(), *data.qfrc_bias])
    np.testing.assert_allclose(*inertia, rtol=1e-6)


def test_what_repeats_with_the_motion_is_found(tmp_path: Path) -> None:
    waves = 2 * np.pi * pl.col("q_axis") / 0.06  # of a torque that the logs do not show
    folder = rewrite(write_folder(tmp_path), pl.col("u_motor") - 3.0 * waves.sin())
    case = read_case(folder)
    assert case.sizes.wave[0, 0] == pytest.approx(0.06, rel=0.01)
    found = diagnosed(case)
    assert found["verdict"] == ["unknown"]
    assert found["unexplained"]["depends_on"].startswith("the position of axis within")
    assert np.ptp(found["unexplained"]["field"]["values"]) == pytest.approx(6.0, rel=0.2)


def test_friction_that_fades_within_a_log_is_found(tmp_path: Path) -> None:
    fades = 2.0 * (-pl.col("t") / 0.4).exp() * pl.col("q_axis").diff().fill_null(0.0).sign()
    folder = rewrite(write_folder(tmp_path, logs=12), pl.col("u_motor") + fades)
    found = diagnosed(read_case(folder))
    assert found["verdict"] == ["unknown"]
    assert found["unexplained"]["depends_on"] == "the time into the log"
    first, *_, last = np.ravel(found["unexplained"]["field"]["values"])
    assert first > 1.2 and abs(last) < 0.4


def sticks(level: float, model: mujoco.MjModel) -> None:
    model.dof_frictionloss[:] = 0.4 * level


def tires(level: float, model: mujoco.MjModel) -> None:
    model.actuator_gainprm[:, 0] -= 0.08 * level


LOGS, WARM = "the order of the logs", "temperature"


@pytest.mark.parametrize(
    ("change", "by", "last"), [(sticks, LOGS, 2.0), (tires, LOGS, -0.4), (sticks, WARM, 2.0)]
)
def test_friction_and_gains_that_change_from_log_to_log_are_found(
    tmp_path: Path, change: Callable[[float, mujoco.MjModel], None], by: str, last: float
) -> None:
    factors = {WARM: {"column": "warmth"}} if by == WARM else {}
    for number, level in enumerate((0, 3, 1, 5, 2, 4) if factors else range(6)):
        own = tmp_path / str(number)
        made = write_folder(own, logs=number + 1, change=partial(change, level), factors=factors)
        rewrite(made, pl.lit(20.0 + 8 * level).alias("warmth"))
        for name in (f"log{number}.csv", "robot.xml", "robot.yaml"):
            (made / name).replace(tmp_path / name)
    case = read_case(tmp_path)
    found = diagnosed(case)
    assert found["verdict"] == ["unknown"]
    assert found["unexplained"]["depends_on"] == by
    if factors:  # the motions to log next are those of a usual warmth
        further, fields = (
            case.motions.further,
            [f"by_{WARM}_field_axis", f"by_{WARM}_gain_field_axis"],
        )
        for name in fields:
            sizes = np.full((1, len(further.model.effects[name].parameters)), 0.1)
            assert np.isfinite(further.model.predict(further.records[:1], [name], sizes)).any()
    values = np.ravel(found["unexplained"]["field"]["values"])
    np.testing.assert_allclose(values, np.linspace(0, last, 5), atol=0.075 * abs(last))
