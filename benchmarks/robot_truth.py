"""Robots with a hidden effect: logs of a truth that no diagnosing model makes.

MuJoCo steps the truth ten times finer, with Runge–Kutta; hidden forces, springs and gaps are made
here a second time; encoders are quantised, noisy and late; servos close their loops on the rotors,
by where the encoders say that these are, without noise.
"""

import re
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import polars as pl
import yaml
from mujoco.batch import Batch, SimulationError

from robotcast.files import seal
from robotcast.robots.effect import RobotEffect
from robotcast.robots.effects import ModelField
from robotcast.robots.library import candidates, library, within
from robotcast.robots.logs import read_logs
from robotcast.robots.model_fields import OneModel
from robotcast.robots.names import address, name_of_dof
from robotcast.robots.robot_file import RobotFile, read_robot
from robotcast.robots.sizes import Sizes, sizes_of
from robotcast.robots.transmission import is_servo, link_inertia
from robotcast.robots.windows import StartStates, noise_of

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
    delay_s: float = 0.0
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
    spec = _spec(hidden.mechanism)
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
    truth = _Truth(spec, hidden, _rng(hidden, seed))
    for number, table in enumerate(truth.sines()):
        truth.write(table, folder / f"log{number:02d}.csv")


def _rng(hidden: Hidden, seed: Sequence[int]) -> np.random.Generator:
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


class _Truth:
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
        keep = np.exp(-step_s / hidden.lag_s) if hidden.lag_s else 0.0
        reached, path = command[:, 0], np.empty((logs, n * per_sample, len(joints)))
        for step in range(n * per_sample):
            path[:, step] = qpos[:, at]
            wanted = command[:, max(step - late, 0) // per_sample]
            reached = wanted + keep * (reached - wanted)
            ctrl[:] = reached - off
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
        times = np.broadcast_to((PERIOD_S * np.arange(n))[:, None], (logs, n, 1))
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
        spec = _spec(hidden.mechanism)
        mass_kg, name = motion["payload_kg"], f"log_next_{number}.csv"
        if mass_kg:
            body = spec.body(motion["fixed_to"])
            weight = body.add_body(name="weight")
            weight.mass, weight.inertia, weight.explicitinertial = mass_kg, [1e-9] * 3, True
            weight.ipos = list(body.ipos)
            loads = said.setdefault("payloads", {}).setdefault(f"body[{body.name}]", {})
            loads[name] = mass_kg
        truth = _Truth(spec, hidden, np.random.default_rng(number))
        wanted = pl.read_csv(folder / motion["file"])
        command = wanted.select([f"u_{a}" for a in truth.drives]).to_numpy()
        truth.write(truth.log(command[None])[0], folder / name)
    (folder / "robot.yaml").write_text(yaml.safe_dump(said, sort_keys=False), encoding="utf-8")


def _spec(mechanism: str) -> mujoco.MjSpec:
    return mujoco.MjSpec.from_file(str(HERE / "mechanisms" / f"{mechanism}.xml"))


DRAWN = {
    # sizes of effects that are drawn, log-uniform, in the unit of their first parameter in
    # conf/robot_effects.yaml: what is usual on the mechanism without them
    "dry_friction": (0.02, 0.5),
    "viscous_friction": (0.02, 1.0),
    "stribeck_friction": (0.02, 0.3),
    "load_friction": (0.03, 0.3),
    "drag": (0.05, 1.5),
    "armature": (0.1, 1.0),
    "spring": (0.05, 0.5),
    "encoder_offset": (0.05, 0.5),
    "encoder_latency": (0.005, 0.04),
    "elastic_joint": (0.01, 0.3),
    "backlash": (0.05, 0.4),
    "mass": (0.15, 1.5),
    "centre_of_mass": (0.1, 0.6),
    "inertia": (0.3, 2.0),
    "tilted_base": (0.03, 0.2),
    "drive_gain": (0.08, 0.5),
    "dead_time": (0.008, 0.06),
    "lag": (0.01, 0.1),
    "torque_limit": (1.0, 6.0),
    "contact_friction": (0.3, 1.5),
    "servo_stiffness": (0.08, 0.8),
}
LAWS = {"dry_friction": "dry", "stribeck_friction": "dry", "load_friction": "load", "drag": "drag"}
ONE = [  # what would be one effect on many mechanisms is no pair
    {"encoder_offset", "centre_of_mass", "tilted_base"},
    {"mass", "inertia", "armature"},
]
SHOWS, SHOWN_S = 5.0, 2.0  # times the encoders' noise, and within how long
SURVIVES = 2.0  # times as far from its middle as without the effect, every joint at most
SIZES_TRIED = 8
QUADRUPEDS = 3


def drawn(seed: int, cases: int) -> dict[str, tuple[str, str]]:
    """Return cases by name: a mechanism, and whether nothing, one, two or an outside effect."""
    rng = np.random.default_rng(seed)
    rounds = [[m for m in MECHANISMS if k < QUADRUPEDS or m != "quadruped"] for k in range(cases)]
    robots = np.concatenate([rng.permutation(some) for some in rounds])[:cases]
    part, twelfth = round(cases / 6), round(cases / 12)
    kinds = ["control"] * part + ["pair"] * part + ["outside"] * twelfth
    kinds = rng.permutation(kinds + ["single"] * (cases - len(kinds)))
    pairs = zip(robots.tolist(), kinds.tolist(), strict=True)
    return {f"{k + 1:02d}_{robot}": (robot, kind) for k, (robot, kind) in enumerate(pairs)}


def draw(mechanism: str, kind: str, seed: Sequence[int]) -> Hidden:
    """Hide an effect of any kind that the mechanism may have, of any size that shows there."""
    rng, nothing = np.random.default_rng(seed), Hidden(mechanism, ["none"])
    if kind == "control":
        return nothing
    with tempfile.TemporaryDirectory() as made:
        make(nothing, Path(made) / "robot", Path(made) / "answer", seed)
        robot = read_robot(Path(made) / "robot")
        logs = read_logs(robot)
        sizes = sizes_of(robot.model, logs, StartStates(robot, logs, noise_of(robot, logs)))
    clean, truth = _shown(nothing, seed), _Draw(robot, sizes, mechanism, rng)
    while True:
        hidden, before = nothing, clean
        for _ in range(2 if kind == "pair" else 1):
            tries = (_joined(hidden, one) for one in truth.sizes(outside=kind == "outside"))
            shown = ((one, _shown(one, seed)) for one in tries if one)
            fit = (pair for pair in shown if _fits(mechanism, pair[1], before, clean))
            hidden, before = next(fit, (nothing, clean))
        if len(hidden.answer) <= 3 and {*hidden.answer} != {"none"}:
            kinds, wanted = {truth.kind(n) for n in hidden.answer}, 2 if kind == "pair" else 1
            if len(kinds) == wanted and not any(len(kinds & one) > 1 for one in ONE):
                return hidden


def _joined(one: Hidden, other: Hidden) -> Hidden | None:
    """Hide both, None where one would undo the other."""
    both: dict[str, Any] = {"answer": [n for n in (*one.answer, *other.answer) if n != "none"]}
    for name in (f.name for f in fields(Hidden) if f.name not in ("mechanism", "answer")):
        own, more = getattr(one, name), getattr(other, name)
        if isinstance(own, Mapping):
            if set(own) & set(more):
                return None
            both[name] = {**own, **more}
        else:
            both[name] = own or more
    return replace(one, **both)


def _shown(hidden: Hidden, seed: Sequence[int]) -> np.ndarray:
    """Return what encoders show, (n_logs, k, n_joints); NaN of a truth that diverges."""
    truth = _Truth(_spec(hidden.mechanism), hidden, _rng(hidden, seed))
    try:
        return truth.sines()[:, :, -len(truth.joints) :]
    except SimulationError:
        return np.array(np.nan)


def _fits(mechanism: str, shown: np.ndarray, before: np.ndarray, clean: np.ndarray) -> bool:
    """Tell whether a hidden effect shows, and whether the mechanism survives it."""
    k, noise = round(SHOWN_S / PERIOD_S), np.sqrt(13 / 12) * np.array(MECHANISMS[mechanism].quantum)
    low, high = clean.min(axis=(0, 1)), clean.max(axis=(0, 1))
    away = np.abs(shown - (low + high) / 2) / ((high - low) / 2)
    if not (away < SURVIVES).all():
        return False
    apart = (shown - before)[:, :k]
    apart -= apart.mean(axis=1, keepdims=True)  # counted from elsewhere
    return bool((np.sqrt((apart**2).mean(axis=(0, 1))) / noise).max() > SHOWS)


class _Draw:
    """Draws hidden effects of one mechanism."""

    def __init__(
        self, robot: RobotFile, usual: Sizes, mechanism: str, rng: np.random.Generator
    ) -> None:
        self._robot, self._usual, self._rng = robot, usual, rng
        self._mechanism, self._entries = mechanism, library()
        whole = [e for e in candidates(robot, usual) if e.depends_on is None]
        self._effects = {e.name: e for one in whole for e in (one, *within(robot, usual, one))}
        self._whole = [e.name for e in whole]

    def kind(self, name: str) -> str:
        """Return an effect's entry in the library."""
        return next((kind for kind in self._entries if name.startswith(kind)), name)

    def sizes(self, *, outside: bool) -> Iterator[Hidden]:
        """Choose an effect, and yield it with one size after the other."""
        rng, model = self._rng, self._robot.model
        if outside:
            dof, law = int(rng.integers(model.nv)), str(rng.choice(["ripple", "stop"]))
            for _ in range(SIZES_TRIED):
                yield self._outside(dof, law)
            return
        kinds = sorted({self.kind(name) for name in self._effects} & set(DRAWN))
        kind = str(rng.choice(kinds))
        effect = self._effects[str(rng.choice([n for n in self._effects if self.kind(n) == kind]))]
        for _ in range(SIZES_TRIED):
            found = self._hidden(kind, effect)
            if found:
                yield replace(Hidden(self._mechanism, [effect.name]), **found)

    def _between(self, low: float, high: float) -> float:
        return float(np.exp(self._rng.uniform(np.log(low), np.log(high))))

    def _outside(self, dof: int, law: str) -> Hidden:
        """Return a torque law that the library lacks: ripple, or a soft stop on one side."""
        usual, between = self._usual, self._between
        torque, position = usual.torque[dof], usual.position[dof]
        ripple = {"ripple": torque * between(0.1, 0.6), "waves": between(3, 10) / position}
        place = (usual.lowest[dof] + usual.highest[dof]) / 2 + position * self._rng.uniform(0, 1)
        stop = {"stop": torque / position * between(0.5, 5), "place": place}
        own = {"ripple": ripple, "stop": stop}[law]
        joint = name_of_dof(self._robot.model, dof)
        return Hidden(self._mechanism, ["unknown"], law={"joint": joint, **own})

    def _hidden(self, kind: str, effect: RobotEffect) -> dict[str, Any] | None:
        """Return an effect by the truth's means with a size; None where these cannot do it."""
        model, where, between, rng = self._robot.model, effect.where, self._between, self._rng
        given, dofs = self._entries[kind]["parameters"], where.dofs or tuple(range(model.nv))
        unit = {n: self._usual.of(p["of"], dofs, where.channels)[0] for n, p in given.items()}
        first = str(rng.choice(list(given)[: 1 if kind != "centre_of_mass" else 3]))
        first = str(rng.choice(list(given))) if kind == "tilted_base" else first
        size, sign = unit[first] * between(*DRAWN[kind]), float(rng.choice([-1, 1]))
        if kind in ("mass", "inertia", "drive_gain", "contact_friction", "servo_stiffness"):
            size = size if sign > 0 else 1 / (1 + size) - 1
        elif kind in ("centre_of_mass", "tilted_base", "encoder_offset"):
            size *= sign
        joints = [name_of_dof(model, dof) for dof in where.dofs]
        drives = [model.actuator(a).name for a in where.actuators]
        sizes = {f"{effect.name}.{first}": size}
        if kind in LAWS:
            if len(joints) > 1:
                return None
            law, force = {"joint": joints[0], LAWS[kind]: size}, size
            if kind == "stribeck_friction":
                own = {"peak": size * between(1, 3), "speed": unit["speed"] * between(0.04, 0.2)}
                law, force = {**law, **own}, size + own["peak"]
                sizes |= {f"{effect.name}.peak": own["peak"]}
            elif kind == "load_friction":
                force = size * self._usual.torque[dofs[0]]
            # as steep as the truth's steps can follow
            step_s = model.opt.timestep / FINER
            least, speed = 1.5 * force * step_s / link_inertia(model, dofs)[0], self._usual.speed
            rate = max(0.004 * speed[dofs[0]], least * (kind != "drag"))
            return (
                {"law": {**law, "rate": rate}, "sizes": sizes}
                if rate < speed[dofs[0]] / 30
                else None
            )
        if kind in ("dead_time", "lag"):  # the truth has them in all drives alike
            answer = [name for name in self._whole if self.kind(name) == kind]
            answer = [n for n in answer if n.endswith("every_joint")] or answer
            sizes = {f"{name}.{first}": size for name in answer}
            late = {"delay_s" if kind == "dead_time" else "lag_s": size}
            return {"answer": answer, "sizes": sizes, **late}
        if kind == "elastic_joint":
            behind = (1 / size, between(0.001, 0.004) / size)
            return {"springs": dict.fromkeys(joints, behind), "sizes": sizes}
        if kind == "backlash":  # without the belt of the slider
            free = dict.fromkeys(joints, (0.0, 0.0))
            return {"gaps": dict.fromkeys(joints, size), "springs": free, "sizes": sizes}
        if kind in ("encoder_offset", "encoder_latency"):
            by = "offset" if kind == "encoder_offset" else "late_s"
            return {by: dict.fromkeys(joints, size), "sizes": sizes}
        if kind == "torque_limit":
            return {"limits": dict.fromkeys(drives, 1 / size), "sizes": sizes}
        if kind == "spring":
            return {"fields": {f"joint[{j}].stiffness": size for j in joints}, "sizes": sizes}
        if kind == "tilted_base":
            down, along = model.opt.gravity[2], "01"["xy".index(first[-1]) ^ 1]
            turned = down * np.sin(size) * (1 if first == "about_y" else -1)
            return {"fields": {f"option.gravity[{along}]": turned}, "sizes": sizes}
        if kind == "drive_gain":
            own = [
                address(model, f"actuator[{a}].{field}", a)
                for a, row in zip(drives, where.actuators, strict=True)
                for field in (("kp", "biasprm[2]") if is_servo(model, row) else ("gear",))
            ]
            changed = {at.name: float(at.nominal(model)[0]) * (1 + size) for at in own}
            return {"fields": changed, "sizes": sizes}
        assert isinstance(effect, ModelField)
        changed = {}
        for at in effect.addresses(model)[first]:
            old = float(at.nominal(model)[0])
            changed[at.name] = old * (1 + size) if effect.how == "scale" else old + size
        return {"fields": changed, "sizes": sizes}
