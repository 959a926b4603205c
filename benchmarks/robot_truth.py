"""Robots with a hidden effect: logs of a truth that no diagnosing model makes.

MuJoCo steps the truth ten times finer, with Runge–Kutta; hidden forces, springs and gaps are made
here a second time; encoders are quantised, noisy and late; servos close their loops on the rotors.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import mujoco
import numpy as np
import polars as pl
import yaml
from mujoco.batch import Batch

from robotcast.rigs.sealed import seal
from robotcast.robots.model_fields import OneModel
from robotcast.robots.names import address

XML = Path(__file__).parent / "mechanisms"
PERIOD_S, FINER = 0.005, 10
Law = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]  # q, v, drive → force on a joint


@dataclass(frozen=True)
class Mechanism:
    """A robot: how strongly every drive is moved about where, and its encoders' steps by joint.

    Attributes
    ----------
    rest : positions of the joints about which they move, one row a kind of log.
    groups : of robot.yaml.
    """

    drive: tuple[float, ...]
    quantum: tuple[float, ...]
    rest: tuple[tuple[float, ...], ...] = ()
    groups: Mapping[str, list[str]] = field(default_factory=dict)
    logs: int = 12
    log_s: float = 4.0


CROUCH = (0.372, *(0.0, 0.6, -1.2) * 4)
MECHANISMS = {
    "cart_pole": Mechanism((4.0,), (1e-4, 5e-4)),
    "two_link": Mechanism((0.8, 1.0), (3e-4, 3e-4)),
    "slider": Mechanism((4.0,), (2e-5,)),
    "lifter": Mechanism((0.25,), (1e-4,), ((0.0,),)),
    "six_axis": Mechanism(
        (0.8, 0.6, 0.8, 0.8, 0.8, 1.0),
        (2e-4,) * 6,
        ((0.0, 0.4, 0.8, 0.0, 0.6, 0.0),),
        {"arm": ["joint_1", "joint_2", "joint_3"], "wrist": ["joint_4", "joint_5", "joint_6"]},
    ),
    "leg": Mechanism((0.25, 0.4), (1e-4, 3e-4, 3e-4), ((0.37, 0.6, -1.2),)),
    "quadruped": Mechanism((0.1, 0.2, 0.3) * 4, (1e-4, *(3e-4,) * 12), (CROUCH,), {}, 1, 20.0),
}


@dataclass(frozen=True)
class Hidden:
    """What is hidden in one case, and what a right verdict says.

    Attributes
    ----------
    answer : the effects; two that these logs cannot tell apart are both right.
    sizes : true parameters by "effect.parameter".
    fields : of the model, as robot.yaml names them.
    springs : stiffness and damping behind a joint; gaps likewise.
    law : a force on a joint.
    renamed : whether joints have other names, and columns another order.
    """

    mechanism: str
    answer: tuple[str, ...]
    sizes: Mapping[str, float] = field(default_factory=dict)
    fields: Mapping[str, float] = field(default_factory=dict)
    springs: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    gaps: Mapping[str, float] = field(default_factory=dict)
    law: tuple[str, Law] | None = None
    delay_s: float = 0.0
    lag_s: float = 0.0
    most: float = np.inf  # torque of servos
    late_s: Mapping[str, float] = field(default_factory=dict)
    offset: Mapping[str, float] = field(default_factory=dict)
    rest: tuple[tuple[float, ...], ...] = ()
    either: bool = False
    renamed: bool = False


def dry(torque: float, rate: float, peak: float = 0.0, speed: float = 1.0) -> Law:
    """Return dry friction as a steep smooth law, stepped finely: not MuJoCo's constraint."""

    def law(q: np.ndarray, v: np.ndarray, u: np.ndarray) -> np.ndarray:
        return -(torque + peak * np.exp(-((v / speed) ** 2))) * np.tanh(v / rate)

    return law


BELT = {"axis": (3e5, 30.0)}  # of the slider's truth, about 100 Hz
GONE = ("none",)
ELBOW_GAP = Hidden(
    "two_link", ("backlash_elbow",), {"backlash_elbow.gap": 0.15}, gaps={"elbow": 0.15}
)
CASES = {
    "cart_pole_control": Hidden("cart_pole", GONE),
    "cart_pole_dry": Hidden(
        "cart_pole",
        ("dry_friction_slider",),
        {"dry_friction_slider.torque": 0.8},
        law=("slider", dry(0.8, 0.004)),
    ),
    "cart_pole_mass": Hidden(
        "cart_pole", ("mass_pole",), {"mass_pole.k": 0.5}, {"body[pole].mass": 0.45}
    ),
    "cart_pole_dead_time": Hidden(
        "cart_pole", ("dead_time_slider",), {"dead_time_slider.tau": 0.04}, delay_s=0.04
    ),
    "cart_pole_latency": Hidden(
        "cart_pole",
        ("encoder_latency_hinge",),
        {"encoder_latency_hinge.tau": 0.02},
        late_s={"hinge": 0.02},
    ),
    "cart_pole_ripple": Hidden(
        "cart_pole", ("unknown",), law=("slider", lambda q, v, u: 1.5 * np.sin(10 * q))
    ),
    "two_link_control": Hidden("two_link", GONE),
    "two_link_dry": Hidden(
        "two_link",
        ("dry_friction_elbow",),
        {"dry_friction_elbow.torque": 0.25},
        law=("elbow", dry(0.25, 0.02)),
    ),
    "two_link_viscous": Hidden(
        "two_link",
        ("viscous_friction_elbow",),
        {"viscous_friction_elbow.damping": 0.27},
        {"joint[elbow].damping": 0.3},
    ),
    "two_link_payload": Hidden(
        "two_link", ("mass_fore",), {"mass_fore.k": 0.6}, {"body[fore].mass": 0.8}
    ),
    "two_link_dead_time": Hidden(
        "two_link", ("dead_time_shoulder", "dead_time_elbow"), delay_s=0.05
    ),
    "two_link_offset": Hidden(
        "two_link",
        ("encoder_offset_shoulder",),
        {"encoder_offset_shoulder.q0": 0.08},
        offset={"shoulder": 0.08},
    ),
    "two_link_elastic": Hidden(
        "two_link",
        ("elastic_joint_elbow",),
        {"elastic_joint_elbow.c": 1 / 15},
        springs={"elbow": (15.0, 0.03)},
    ),
    "two_link_backlash": ELBOW_GAP,
    "two_link_backlash_renamed": replace(ELBOW_GAP, renamed=True),
    "two_link_saturation": Hidden(
        "two_link", ("torque_limit_shoulder", "torque_limit_elbow"), most=1.5
    ),
    "slider_control": Hidden("slider", GONE),
    "slider_dry": Hidden(
        "slider",
        ("dry_friction_axis",),
        {"dry_friction_axis.torque": 6.0},
        law=("axis", dry(6.0, 0.002)),
    ),
    "slider_stribeck": Hidden(
        "slider",
        ("stribeck_friction_axis",),
        {"stribeck_friction_axis.torque": 4.0, "stribeck_friction_axis.peak": 8.0},
        law=("axis", dry(4.0, 0.002, 8.0, 0.3)),
    ),
    "slider_drag": Hidden(
        "slider",
        ("drag_axis",),
        {"drag_axis.c": 30.0},
        law=("axis", lambda q, v, u: -30 * v * abs(v)),
    ),
    "slider_gain": Hidden(
        "slider", ("drive_gain_axis",), {"drive_gain_axis.k": -0.2}, {"actuator[motor].gear": 8.0}
    ),
    "slider_lag": Hidden("slider", ("lag_axis",), {"lag_axis.tau": 0.05}, lag_s=0.05),
    "slider_belt": Hidden(
        "slider",
        ("elastic_joint_axis",),
        {"elastic_joint_axis.c": 1 / 4000},
        springs={"axis": (4000.0, 8.0)},
    ),
    "six_axis_control": Hidden("six_axis", GONE),
    "six_axis_payload": Hidden(
        "six_axis", ("mass_tool",), {"mass_tool.k": 1.0}, {"body[tool].mass": 1.0}
    ),
    "six_axis_dead_time": Hidden("six_axis", ("dead_time_arm", "dead_time_wrist"), delay_s=0.03),
    "six_axis_wrist": Hidden(
        "six_axis",
        ("viscous_friction_wrist",),
        {"viscous_friction_wrist.damping": 0.5},
        {"joint[joint_4].damping": 0.55, "joint[joint_5].damping": 0.55}
        | {"joint[joint_6].damping": 0.53},
    ),
    "leg_control": Hidden("leg", GONE),
    "leg_dry": Hidden(
        "leg",
        ("dry_friction_knee",),
        {"dry_friction_knee.torque": 1.0},
        law=("knee", dry(1.0, 0.02)),
    ),
    "leg_ice": Hidden(
        "leg",
        ("contact_friction",),
        {"contact_friction.k": -0.6},
        {"geom[foot].friction": 0.32, "geom[floor].friction": 0.32},
    ),
    "leg_payload": Hidden("leg", ("mass_trunk",), {"mass_trunk.k": 0.5}, {"body[trunk].mass": 4.5}),
    "lifter_one_load": Hidden(
        "lifter",
        ("load_friction_lift", "dry_friction_lift"),
        law=("lift", lambda q, v, u: -0.15 * abs(u) * np.tanh(v / 0.01)),
        either=True,
    ),
    "lifter_two_loads": Hidden(
        "lifter",
        ("load_friction_lift",),
        {"load_friction_lift.mu": 0.15},
        law=("lift", lambda q, v, u: -0.15 * abs(u) * np.tanh(v / 0.01)),
        rest=((0.0,), (-1.3,)),
    ),
    "quadruped_control": Hidden("quadruped", GONE),
    "quadruped_knees": Hidden(
        "quadruped",
        ("viscous_friction_calf_joint",),
        {"viscous_friction_calf_joint.damping": 0.5},
        {f"joint[{leg}_calf_joint].damping": 0.6 for leg in ("FL", "FR", "RL", "RR")},
    ),
    "quadruped_one_knee": Hidden(
        "quadruped",
        ("viscous_friction_RL_calf_joint",),
        {"viscous_friction_RL_calf_joint.damping": 1.0},
        {"joint[RL_calf_joint].damping": 1.1},
    ),
}


def make(case: str, folder: Path, sealed: Path, seed: int = 0) -> None:
    """Write a folder with a model, logs and robot.yaml; the answer stands sealed elsewhere."""
    hidden = CASES[case]
    mechanism = MECHANISMS[hidden.mechanism]
    text = (XML / f"{hidden.mechanism}.xml").read_text(encoding="utf-8")
    spec = mujoco.MjSpec.from_string(text)
    joints, drives = ([one.name for one in some] for some in (spec.joints, spec.actuators))
    to = {j: f"axis_{9 - k}" if hidden.renamed else j for k, j in enumerate(joints)}
    folder.mkdir(parents=True, exist_ok=True)
    new = re.sub(r'(joint name|joint)="(\w+)"', lambda m: f'{m[1]}="{to[m[2]]}"', text)
    (folder / "robot.xml").write_text(new, encoding="utf-8")
    order = -1 if hidden.renamed else 1
    said = {
        "model": "robot.xml",
        "logs": "log*.csv",
        "time": {"column": "t", "unit": "s"},
        "drive": {f"actuator[{a}]": {"column": f"u_{a}"} for a in drives[::order]},
        "measured": {f"joint[{to[j]}].position": {"column": f"q_{j}"} for j in joints[::order]},
    }
    said |= {"groups": dict(mechanism.groups)} if mechanism.groups else {}
    (folder / "robot.yaml").write_text(yaml.safe_dump(said, sort_keys=False), encoding="utf-8")

    def renamed(name: str) -> str:
        return next((name.replace(j, new) for j, new in to.items() if j in name), name)

    seal(
        {
            "answer": [renamed(name) for name in hidden.answer],
            "sizes": {renamed(name): size for name, size in hidden.sizes.items()},
            "either": hidden.either,
        },
        sealed,
    )
    columns = ["t", *(f"u_{a}" for a in drives), *(f"q_{j}" for j in joints)]
    # the same noise whatever the hidden effect's name
    rng = np.random.default_rng([seed, *hidden.mechanism.encode()])
    for number, table in enumerate(_logs(_truth(spec, hidden), joints, mechanism, hidden, rng)):
        frame = pl.DataFrame(dict(zip(columns, table.T, strict=True)))
        frame.write_csv(folder / f"log{number:02d}.csv", float_precision=7)


def _truth(spec: mujoco.MjSpec, hidden: Hidden) -> mujoco.MjModel:
    """Return the model that moves: with springs and gaps behind joints, and other fields."""
    springs = {**(BELT if hidden.mechanism == "slider" else {}), **hidden.springs}
    for name in {*springs, *hidden.gaps}:
        joint = spec.joint(name)
        joint.parent.simple = 0  # MuJoCo takes two slides along one axis for orthogonal ones
        twist = joint.parent.add_joint(name=f"{name} twist", type=joint.type)
        twist.axis, twist.pos = joint.axis, joint.pos
        if name in springs:
            twist.stiffness[0], twist.damping[0] = springs[name]
        if name in hidden.gaps:
            twist.limited, reach = int(mujoco.mjtLimited.mjLIMITED_TRUE), hidden.gaps[name] / 2
            twist.range = np.degrees([-reach, reach]) if spec.compiler.degree else [-reach, reach]
            twist.solref_limit = [0.004, 1.0]
    for actuator in spec.actuators if np.isfinite(hidden.most) else ():
        actuator.forcelimited = int(mujoco.mjtLimited.mjLIMITED_TRUE)
        actuator.forcerange = [-hidden.most, hidden.most]
    model = spec.compile()
    fields = OneModel(model)
    for name, value in hidden.fields.items():
        fields.set(address(model, name, name), np.array([[value]]))
    mujoco.mj_setConst(model, mujoco.MjData(model))
    model.opt.timestep /= FINER
    model.opt.integrator = int(mujoco.mjtIntegrator.mjINT_RK4)
    return model


def _logs(
    model: mujoco.MjModel,
    joints: list[str],
    mechanism: Mechanism,
    hidden: Hidden,
    rng: np.random.Generator,
) -> np.ndarray:
    """Run all logs side by side: sums of sines as commands, quantised and noisy encoders."""
    logs, n, step_s = mechanism.logs, round(mechanism.log_s / PERIOD_S), model.opt.timestep
    batch = Batch(model, logs, nthread=1)
    qpos, qvel, ctrl, applied = map(batch.bind, ("qpos", "qvel", "ctrl", "qfrc_applied"))
    actuated = batch.bind("qfrc_actuator")
    at = [int(model.joint(j).qposadr[0]) for j in joints]
    dofs = [int(model.joint(j).dofadr[0]) for j in joints]
    rest = np.array(hidden.rest or mechanism.rest or ((0.0,) * len(joints),))
    rest = rest[np.arange(logs) % len(rest)]
    qpos[:, at] = rest
    t_s = PERIOD_S * np.arange(n)
    driven = [
        dofs.index(int(model.jnt_dofadr[model.actuator_trnid[a, 0]])) for a in range(model.nu)
    ]
    servo = model.actuator_biasprm[:, 1] != 0
    command = np.repeat((rest[:, driven] * servo)[:, None], n, axis=1)
    for log, channel, _ in np.ndindex(logs, model.nu, 4):
        wave = np.sin(2 * np.pi * (rng.uniform(0.2, 2.0) * t_s + rng.uniform()))
        command[log, :, channel] += mechanism.drive[channel] / 2 * wave
    late, per_sample = round(hidden.delay_s / step_s), round(PERIOD_S / step_s)
    keep = np.exp(-step_s / hidden.lag_s) if hidden.lag_s else 0.0
    reached, path = command[:, 0], np.empty((logs, n * per_sample, len(joints)))
    for step in range(n * per_sample):
        path[:, step] = qpos[:, at]
        wanted = command[:, max(step - late, 0) // per_sample]
        reached = wanted + keep * (reached - wanted)
        ctrl[:] = reached
        if hidden.law is not None:
            joint, law = hidden.law
            k = joints.index(joint)
            applied[:, dofs[k]] = law(qpos[:, at[k]], qvel[:, dofs[k]], actuated[:, dofs[k]])
        batch.step()
    seen = np.empty((logs, n, len(joints)))
    for k, joint in enumerate(joints):
        behind = round(hidden.late_s.get(joint, 0.0) / step_s)
        steps = np.maximum(per_sample * np.arange(n) - behind, 0)
        seen[:, :, k] = path[:, steps, k] + hidden.offset.get(joint, 0.0)
    quantum = np.array(mechanism.quantum)
    seen = np.round((seen + quantum * rng.normal(size=seen.shape)) / quantum) * quantum
    times = np.broadcast_to(t_s[:, None], (logs, n, 1))
    return np.concatenate([times, command, seen], axis=-1)
