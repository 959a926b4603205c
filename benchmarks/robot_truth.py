"""Robots with a hidden effect: logs of a truth that no diagnosing model makes.

MuJoCo steps the truth ten times finer, with Runge–Kutta; hidden forces, springs and gaps are made
here a second time; encoders are quantised, noisy and late; servos close their loops on the rotors,
by where the encoders say that these are, without noise.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import polars as pl
import yaml
from mujoco.batch import Batch

from robotcast.files import seal
from robotcast.robots.model_fields import OneModel
from robotcast.robots.names import address

HERE = Path(__file__).parent
PERIOD_S, FINER = 0.005, 10


@dataclass(frozen=True)
class Mechanism:
    """A robot: how strongly every drive is moved about where, and its encoders' steps by joint."""

    drive: tuple[float, ...]
    quantum: tuple[float, ...]
    rest: tuple[tuple[float, ...], ...] = ()  # positions of the joints, one row a kind of log
    groups: Mapping[str, list[str]] = field(default_factory=dict)  # of robot.yaml
    logs: int = 12
    log_s: float = 4.0
    hertz: tuple[float, float] = (0.2, 2.0)  # of the sines


CROUCH = (0.372, *(0.0, 0.6, -1.2) * 4)
MECHANISMS = {
    "cart_pole": Mechanism((4.0,), (1e-4, 5e-4)),
    "two_link": Mechanism((0.8, 1.0), (3e-4, 3e-4)),
    "slider": Mechanism((4.0,), (2e-5,)),
    "lifter": Mechanism((0.1,), (5e-4,), ((0.0,),), hertz=(0.1, 0.5)),  # its load is its weight
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
    """What is hidden in one case, and what a right verdict says."""

    mechanism: str
    answer: Sequence[str]  # the effects
    sizes: Mapping[str, float] = field(default_factory=dict)  # by "effect.parameter"
    fields: Mapping[str, float] = field(default_factory=dict)  # as robot.yaml names them
    # stiffness and damping behind a joint; gaps likewise
    springs: Mapping[str, Sequence[float]] = field(default_factory=dict)
    gaps: Mapping[str, float] = field(default_factory=dict)
    law: Mapping[str, Any] = field(default_factory=dict)  # a force on a joint, see `pushed`
    delay_s: float = 0.0  # of commands; negative where they are stamped late
    clock: float = 0.0  # by how much that of the logs runs fast
    tires: float = 0.0  # by how much less drives push from log to log
    lag_s: float = 0.0
    limits: Mapping[str, float] = field(default_factory=dict)  # of the torque of servos
    late_s: Mapping[str, float] = field(default_factory=dict)
    offset: Mapping[str, float] = field(default_factory=dict)
    rest: Sequence[Sequence[float]] = ()
    either: bool = False  # two effects that these logs cannot tell apart are both right
    renamed: bool = False  # joints have other names, and columns another order


def pushed(law: Mapping[str, Any], q: np.ndarray, v: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Return a hidden force by position, speed and drive.

    Dry friction is a steep smooth law, stepped finely: not MuJoCo's constraint.
    """
    known = {"dry": 0.0, "peak": 0.0, "speed": 1.0, "rate": 1.0, "load": 0.0, "drag": 0.0}
    known |= {"ripple": 0.0, "waves": 1.0, "stop": 0.0, "place": 0.0, **law}
    dry = known["dry"] + known["peak"] * np.exp(-((v / known["speed"]) ** 2))
    dry = dry + known["load"] * np.abs(u)
    smooth = known["ripple"] * np.sin(known["waves"] * q) - known["drag"] * v * np.abs(v)
    smooth = smooth - known["stop"] * np.maximum(q - known["place"], 0.0)
    return smooth - dry * np.tanh(v / known["rate"])


BELT = {"axis": (3e5, 30.0)}  # of the slider's truth, about 100 Hz
CASES = {
    case: Hidden(**said)
    for case, said in yaml.safe_load((HERE / "robot_cases.yaml").read_text()).items()
}


def make(hidden: Hidden, folder: Path, sealed: Path, seed: Sequence[int] = (0,)) -> None:
    """Write a folder with a model, logs and robot.yaml; the answer stands sealed elsewhere."""
    mechanism = MECHANISMS[hidden.mechanism]
    text = (HERE / "mechanisms" / f"{hidden.mechanism}.xml").read_text(encoding="utf-8")
    spec = spec_of(hidden.mechanism)
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
    truth = Truth(spec, hidden, rng_of(hidden, seed))
    for number, table in enumerate(truth.sines()):
        truth.write(table, folder / f"log{number:02d}.csv")


def rng_of(hidden: Hidden, seed: Sequence[int]) -> np.random.Generator:
    """Return what draws motions and noise, the same whatever is hidden."""
    return np.random.default_rng([*seed, *hidden.mechanism.encode()])


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
    for name, most in hidden.limits.items():
        actuator = spec.actuator(name)
        actuator.forcelimited = int(mujoco.mjtLimited.mjLIMITED_TRUE)
        actuator.forcerange = [-most, most]
    model = spec.compile()
    fields = OneModel(model)
    for name, value in hidden.fields.items():
        fields.set(address(model, name, name), np.array([[value]]))
    mujoco.mj_setConst(model, mujoco.MjData(model))
    model.opt.timestep /= FINER
    model.opt.integrator = int(mujoco.mjtIntegrator.mjINT_RK4)
    return model


def _commands(
    mechanism: Mechanism, rest: np.ndarray, channels: int, rng: np.random.Generator
) -> np.ndarray:
    """Return sums of sines about where the drives rest, (n_logs, k, n_channels)."""
    t_s = PERIOD_S * np.arange(round(mechanism.log_s / PERIOD_S))
    command = np.repeat(rest[:, None], len(t_s), axis=1)
    for log, channel, _ in np.ndindex(len(rest), channels, 4):
        wave = np.sin(2 * np.pi * (rng.uniform(*mechanism.hertz) * t_s + rng.uniform()))
        command[log, :, channel] += mechanism.drive[channel] / 2 * wave
    return command


class Truth:
    """The robot that moves, its law in force, and its encoders."""

    def __init__(self, spec: mujoco.MjSpec, hidden: Hidden, rng: np.random.Generator) -> None:
        self.hidden, self.mechanism, self.rng = hidden, MECHANISMS[hidden.mechanism], rng
        self.joints = [joint.name for joint in spec.joints]
        self.drives = [actuator.name for actuator in spec.actuators]
        self.model = _truth(spec, hidden)

    def sines(self) -> np.ndarray:
        """Return the logs of sines about where the mechanism rests."""
        model, logs = self.model, self.mechanism.logs
        servo = model.actuator_biasprm[:, 1] != 0
        rest = self._rest(logs)
        driven = [self.joints.index(model.joint(j).name) for j in model.actuator_trnid[:, 0]]
        return self.log(_commands(self.mechanism, rest[:, driven] * servo, model.nu, self.rng))

    def _rest(self, logs: int) -> np.ndarray:
        still = ((0.0,) * len(self.joints),)
        rest = np.array(self.hidden.rest or self.mechanism.rest or still)
        return rest[np.arange(logs) % len(rest)]

    def log(self, command: np.ndarray) -> np.ndarray:
        """Run logs side by side; return time, commands and encoders, (n_logs, k, columns)."""
        model, joints, hidden = self.model, self.joints, self.hidden
        (logs, n, _), step_s = command.shape, model.opt.timestep
        batch = Batch(model, logs, nthread=1)
        qpos, qvel, ctrl, applied = map(batch.bind, ("qpos", "qvel", "ctrl", "qfrc_applied"))
        actuated = batch.bind("qfrc_actuator")
        at = [int(model.joint(j).qposadr[0]) for j in joints]
        dofs = [int(model.joint(j).dofadr[0]) for j in joints]
        qpos[:, at] = self._rest(logs)
        late, per_sample = round(hidden.delay_s / step_s), round(PERIOD_S / step_s)
        servo = model.actuator_biasprm[:, 1] != 0
        driven = [model.joint(j).name for j in model.actuator_trnid[:, 0]]
        off = servo * [hidden.offset.get(j, 0.0) for j in driven]
        gain = 1 - hidden.tires * np.arange(logs)[:, None]
        keep = np.exp(-step_s / hidden.lag_s) if hidden.lag_s else 0.0
        reached, path = command[:, 0], np.empty((logs, n * per_sample, len(joints)))
        for step in range(n * per_sample):
            path[:, step] = qpos[:, at]
            wanted = command[:, min(max(step - late, 0) // per_sample, n - 1)]
            reached = wanted + keep * (reached - wanted)
            ctrl[:] = gain * (reached - off)
            if hidden.law:
                k = joints.index(hidden.law["joint"])
                moved = qpos[:, at[k]], qvel[:, dofs[k]], actuated[:, dofs[k]]
                applied[:, dofs[k]] = pushed(hidden.law, *moved)
            batch.step()
        seen = np.empty((logs, n, len(joints)))
        for k, joint in enumerate(joints):
            behind = round(hidden.late_s.get(joint, 0.0) / step_s)
            steps = np.maximum(per_sample * np.arange(n) - behind, 0)
            seen[:, :, k] = path[:, steps, k] + hidden.offset.get(joint, 0.0)
        quantum = np.array(self.mechanism.quantum)
        seen = np.round((seen + quantum * self.rng.normal(size=seen.shape)) / quantum) * quantum
        times_s = (1 + hidden.clock) * PERIOD_S * np.arange(n)
        times = np.broadcast_to(times_s[:, None], (logs, n, 1))
        return np.concatenate([times, command, seen], axis=-1)

    def write(self, table: np.ndarray, path: Path) -> None:
        """Write a log (k, columns)."""
        columns = ["t", *(f"u_{a}" for a in self.drives), *(f"q_{j}" for j in self.joints)]
        frame = pl.DataFrame(dict(zip(columns, table.T, strict=True)))
        frame.write_csv(path, float_precision=7)


def log_next(hidden: Hidden, folder: Path, asked: Sequence[Mapping[str, Any]]) -> None:
    """Log the motions that a diagnosis asks for, with what it asks to be fixed to a link."""
    said = yaml.safe_load((folder / "robot.yaml").read_text(encoding="utf-8"))
    for number, motion in enumerate(asked):
        spec = spec_of(hidden.mechanism)
        mass_kg, name = motion["payload_kg"], f"log_next_{number}.csv"
        if mass_kg:
            body = spec.body(motion["fixed_to"])
            weight = body.add_body(name="weight")
            weight.mass, weight.inertia, weight.explicitinertial = mass_kg, [1e-9] * 3, True
            weight.ipos = list(body.ipos)
            loads = said.setdefault("payloads", {}).setdefault(f"body[{body.name}]", {})
            loads[name] = mass_kg
        truth = Truth(spec, hidden, np.random.default_rng(number))
        wanted = pl.read_csv(folder / motion["file"])
        command = wanted.select([f"u_{a}" for a in truth.drives]).to_numpy()
        truth.write(truth.log(command[None])[0], folder / name)
    (folder / "robot.yaml").write_text(yaml.safe_dump(said, sort_keys=False), encoding="utf-8")


def spec_of(mechanism: str) -> mujoco.MjSpec:
    return mujoco.MjSpec.from_file(str(HERE / "mechanisms" / f"{mechanism}.xml"))
