"""Between a drive and its link: the resonance of a spring, the dead band of a gap, no more."""

from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import polars as pl
import pytest
from mujoco.batch import Batch

from robotcast.fitting.parameter import Parameter
from robotcast.robots import robot_model
from robotcast.robots.effect import Where
from robotcast.robots.logs import read_logs
from robotcast.robots.robot_case import read_case
from robotcast.robots.robot_file import read_robot
from robotcast.robots.transmission import Backlash, ElasticJoint, Transmission
from robotcast.robots.windows import StartStates
from tests.robots.made_up_robot import SLIDER, rewrite, write_folder

ROTOR, LINK, STEP_S = 0.02, 0.05, 0.002
JOINT = f"""
<mujoco><option timestep="{STEP_S}" integrator="implicitfast"/><worldbody>
<body name="link"><joint name="hinge" axis="0 0 1" armature="{ROTOR}" BRAKE/>
<inertial pos="0 0 0" mass="1" diaginertia="{LINK} {LINK} {LINK}"/></body></worldbody>
<tendon><fixed><joint joint="hinge" coef="1"/></fixed></tendon>
<actuator>DRIVE</actuator></mujoco>"""
MOTOR = '<motor joint="hinge"/>'
SERVO = '<position joint="hinge" kp="30" kv="0.8"/>'
BRAKES = [
    "",
    'damping="0.15 0.05 0.02"',
    'frictionloss="0.1"',
    'damping="0.05" frictionloss="0.05"',
]
WHERE = Where("hinge", (0,), (1,), (0,), (0,))


def parameter(name: str) -> Parameter:
    return Parameter(name, "1", 0.0, 1.0, 0.0, null=0.0)


def elastic() -> ElasticJoint:
    return ElasticJoint("elastic", "", [parameter("c"), parameter("retardation")], WHERE)


def backlash() -> Backlash:
    return Backlash("backlash", "", [parameter("gap")], WHERE, usual=1.0)


def sine(t_s: float) -> float:
    return 0.5 * np.sin(9 * t_s)


def moved(
    effect: ElasticJoint | Backlash,
    values: dict[str, list[float]],
    command: Callable[[float], float],
    *,
    drive: str = MOTOR,
    brake: str = "",
    held: float = 0.0,
    length_s: float = 1.0,
    step_s: float = STEP_S,
) -> tuple[np.ndarray, np.ndarray]:
    """Return what the encoder shows and where the link is, (n_steps, n_sim) each.

    Dry friction by which the link is `held` [N m] is in a tendon along the joint.
    """
    xml = JOINT.replace("DRIVE", drive).replace("BRAKE", brake)
    model = mujoco.MjModel.from_xml_string(xml)
    model.opt.timestep, model.tendon_frictionloss[:] = step_s, held
    own = {name: np.array(some)[:, None] for name, some in values.items()}
    batch = Batch(model, len(next(iter(own.values()))), nthread=1)
    between = Transmission(batch, [(effect, own)])
    qpos, qvel, ctrl, applied = map(batch.bind, ("qpos", "qvel", "ctrl", "qfrc_applied"))
    shown, link = [], []
    for k in range(round(length_s / step_s)):
        ctrl[:] = command(k * step_s)
        applied[:] = 0.0
        if k == 0:
            between.place(np.zeros((batch.nsim, 2, 1)))
        seen = qpos.copy()
        between.show(seen, qvel.copy())
        shown.append(seen[:, 0])
        link.append(qpos[:, 0].copy())
        between.apply()
        batch.step()
        between.advance()
    return np.array(shown), np.array(link)


def pulse(t_s: float) -> float:
    return 1.0 if 0.01 <= t_s < 0.03 else 0.0


@pytest.mark.parametrize("stiffness", [10.0, 60.0, 400.0])
def test_two_masses_resonate_at_the_frequency_of_their_reduced_mass(stiffness: float) -> None:
    c = 1 / stiffness
    shown, link = moved(elastic(), {"c": [c], "retardation": [0.0]}, pulse, length_s=2.0)
    twist = (shown - link)[50:, 0]
    crossings = np.flatnonzero(np.diff(np.sign(twist)) > 0)
    period_s = STEP_S * (crossings[-1] - crossings[0]) / (len(crossings) - 1)
    wanted_hertz = np.sqrt(stiffness * (1 / ROTOR + 1 / LINK)) / (2 * np.pi)
    assert 1 / period_s == pytest.approx(wanted_hertz, rel=0.02)
    assert np.abs(twist[-200:]).max() == pytest.approx(np.abs(twist[:200]).max(), rel=0.02)


def test_retardation_damps_a_spring_as_it_says() -> None:
    stiffness, retardation_s = 60.0, 0.004
    values = {"c": [1 / stiffness], "retardation": [retardation_s]}
    shown, link = moved(elastic(), values, pulse)
    twist, omega = (shown - link)[20:, 0], np.sqrt(stiffness * (1 / ROTOR + 1 / LINK))
    peaks = np.flatnonzero((twist[1:-1] > twist[:-2]) & (twist[1:-1] > twist[2:])) + 1
    decrement = np.log(twist[peaks[0]] / twist[peaks[2]]) / (2 * np.pi * 2)
    assert decrement == pytest.approx(retardation_s * omega / 2, rel=0.15)


@pytest.mark.parametrize("brake", BRAKES)
@pytest.mark.parametrize("drive", [MOTOR, SERVO])
@pytest.mark.parametrize("name", ["c", "gap"])
def test_the_null_limit_is_the_rigid_joint(name: str, drive: str, brake: str) -> None:
    made = elastic() if name == "c" else backlash()
    values = {p.name: [0.0] * 3 for p in made.parameters} | {name: [0.0, 1e-8, 1e-5]}
    shown, _ = moved(made, values, lambda t_s: np.sin(12 * t_s), drive=drive, brake=brake)
    off = np.abs(shown[:, 1:] - shown[:, :1]).max(axis=0) / np.abs(shown[:, 0]).max()
    assert off[0] < 1e-3
    assert off[1] < 5e-3


def test_a_rotor_turns_within_its_gap_while_friction_holds_the_link() -> None:
    gap = 0.08
    values = {"gap": [gap, gap / 2]}
    shown, link = moved(backlash(), values, sine, held=30.0, length_s=3.0)
    assert np.ptp(link, axis=0).max() < 0.05 * gap
    late = shown[len(shown) // 3 :]
    np.testing.assert_allclose(np.ptp(late, axis=0), [gap, gap / 2], rtol=0.1)
    np.testing.assert_allclose(np.abs(shown - link).max(axis=0), [gap / 2, gap / 4], rtol=0.15)


@pytest.mark.parametrize("brake", BRAKES)
@pytest.mark.parametrize("drive", [MOTOR, SERVO])
@pytest.mark.parametrize(
    ("made", "values"),
    [(elastic(), {"c": 0.02, "retardation": 0.002}), (backlash(), {"gap": 0.1})],
)
def test_a_second_joint_in_the_patched_model_moves_alike(
    made: ElasticJoint | Backlash, values: dict[str, float], drive: str, brake: str
) -> None:
    both = {name: [value, 0.0] for name, value in values.items()}
    shown, _ = moved(made, both, sine, drive=drive, brake=brake, step_s=STEP_S / 4)
    xml = JOINT.replace("DRIVE", drive).replace("BRAKE", brake)
    spec = mujoco.MjSpec.from_string(xml)
    assert made.patch(spec, mujoco.MjModel.from_xml_string(xml), **values)
    model = spec.compile()
    model.opt.timestep, model.opt.integrator = STEP_S / 8, int(mujoco.mjtIntegrator.mjINT_RK4)
    data, path = mujoco.MjData(model), []
    for k in range(len(shown)):
        path.append(float(data.qpos[0]))
        data.ctrl[:] = sine(k * STEP_S / 4)
        mujoco.mj_step(model, data, 2)
    off, moves = np.abs(shown[:, 0] - path).max(), np.abs(shown[:, 0] - shown[:, 1]).max()
    assert off < 0.15 * moves


def test_a_start_knows_that_the_drive_pushes_a_rotor_anew_with_every_command(
    tmp_path: Path,
) -> None:
    rotor, period_s = 3.0, 0.01
    heavy = SLIDER.replace('range="-3 3"', f'range="-3 3" armature="{rotor}"')
    folder = write_folder(tmp_path, heavy, logs=1)
    times_s = period_s * np.arange(150)
    pushed = np.random.default_rng(0).uniform(-10, 10, len(times_s)) / rotor
    held = pl.Series(5 / rotor / 8**2 * np.sin(8 * times_s))  # by a spring, with 5 sin(8 t) N
    rate = np.r_[0.0, np.cumsum(pushed[:-1] * period_s)]
    path = np.r_[0.0, np.cumsum((rate[1:] + rate[:-1]) / 2 * period_s)]
    rewrite(folder, u_motor=pl.Series(rotor * pushed), q_axis=held + path)
    robot = read_robot(folder)
    starts = StartStates(robot, read_logs(robot), np.array([1e-6]))
    at = np.arange(20, 130)
    found = np.array([starts.bends(0, int(k))[0][:, 0] for k in at])
    spring = -5 / rotor * np.array([np.sin(8 * times_s[at]), 8 * np.cos(8 * times_s[at])]).T
    wanted = spring + np.column_stack([pushed[at], np.zeros(len(at))])
    assert (np.abs(found - wanted) < 0.02 * np.abs(spring).max(axis=0)).all()


def test_how_far_a_link_hangs_behind_is_fitted_where_samples_leave_it_open(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    spring, heavy = 60.0, SLIDER.replace('range="-3 3"', 'range="-3 3" armature="1"')
    case = read_case(write_folder(tmp_path, heavy, spring=spring))
    true = np.array([[1 / spring, 0.005]])

    def missed() -> float:
        paths = case.model.predict(case.model.records, ["elastic_joint_axis"], true)[0]
        return case.model.usual_miss(case.model.misses(paths))

    fitted = missed()
    monkeypatch.setattr(robot_model, "FEW_ELASTIC", 0)
    assert fitted < 1.5 * case.floor.percent < missed()
