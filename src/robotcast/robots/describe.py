"""A first robot.yaml, guessed from the names in a model and in the header of a log."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import mujoco
import numpy as np
import polars as pl

from robotcast.files import write_text
from robotcast.robots.closure import Followers
from robotcast.robots.names import (
    AXES,
    FREE,
    PLACE,
    UNITS,
    WIDTH,
    is_hinge,
    joint_of_actuator,
    names_of,
)
from robotcast.robots.recordings import tables_of
from robotcast.robots.robot_file import FILE, compiled, load_spec

TIMES = set(["time", "t", "timestamp", "stamp", "times", "sec", "seconds", "secs", "clock"])
WORDS = {
    "torque": "tau torque torques effort efforts current currents moment force forces",
    "command": "u ctrl control command commanded commands cmd con des desired target action "
    "actions ref reference setpoint goal",
    "velocity": "v dq qd dqpos vel velocity velocities qvel speed omega rate rpm",
    "position": "q pos position positions angle angles theta qpos deg degrees state encoder",
}
KINDS = {kind: set(words.split()) for kind, words in WORDS.items()}  # the first that fits
TURNS = {"quat", "quaternion", "orientation", "rotation", "rot", *(f"q{a}" for a in AXES)}
RATES = {"linear", "angular", "acc", "gyro"}.union(*(KINDS[k] for k in KINDS if k != "position"))
FAR, FAST = 13.0, 150.0  # radians, and radians per second, that are looked at twice
TOO_MUCH = 30.0  # times the energy that gravity and drives can give: the angle is in degrees
SPELLED = {  # SI unit → how a column's name has a unit of its kind → the unit
    si: {re.sub("/s$| ", "", unit).lower(): unit for unit in reversed(known)}
    for si, known in UNITS.items()
} | {"A": {"ma": "mA"}}  # of a drive: a torque by its constant, which robot.yaml must be given
LENGTHS = {*SPELLED["rad"], *SPELLED["m"]}
FORCES, VOLTS = {"n", "nm"}, {"volt", "volts"}
ANY = LENGTHS.union(*SPELLED.values()) - set(SPELLED["s"])
TORQUES = ("N m", "N")
AS_COMMANDED = 0.5  # of a joint's variance: what is nearer to it is the position that it follows
MORE = 8.0  # times as far as the joint: its command, or speed, is in degrees
PERIODS = (("ns", 2e5), ("us", 200.0), ("ms", 0.3))  # unit → least usual step in it


def describe(folder: Path) -> tuple[Path, list[str]]:
    """Write FOLDER/robot.yaml; return it and what is to be looked at, a sentence each."""
    path = folder / FILE
    if path.exists():
        raise ValueError(f"{path} exists already: rename it, or edit it")
    model_path = _model_in(folder)
    logs = sorted(p for e in ("csv", "parquet", "mcap") for p in folder.rglob(f"*.{e}"))
    if not logs:
        raise ValueError(f"{folder}: no log (.csv, .parquet or .mcap) lies in it")
    spec = load_spec(model_path)
    _, table = tables_of(logs[0])[0]
    guess = _Guess(compiled(spec, model_path), table)
    load_spec(model_path, guess.weld)  # what cannot be welded is said before anything is written
    write_text(path, _text(folder, model_path, logs, guess))
    return path, _remarks(logs[0], guess)


def _model_in(folder: Path) -> Path:
    """Return the model that no other one in the folder, or else below it, includes."""
    for among in (folder.glob, folder.rglob):
        found = sorted(p for e in ("xml", "urdf", "mjcf") for p in among(f"*.{e}"))
        texts = {p: p.read_text(encoding="utf-8", errors="replace") for p in found}
        if found := [p for p in found if re.search(r"<(mujoco|robot)\b", texts[p])]:
            break
    included = {
        (p.parent / name).resolve()
        for p in found
        for name in re.findall(r'<include\s+file="([^"]+)"', texts[p])
    }
    tops = [p for p in found if p.resolve() not in included]
    if len(tops) != 1:
        names = ", ".join(p.relative_to(folder).as_posix() for p in tops) or "none"
        raise ValueError(f"{folder}: expected an MJCF or URDF file, one; found {names}")
    return tops[0]


class _Guess:
    """What robot.yaml will say of a model and a log: target → column and unit."""

    def __init__(self, model: mujoco.MjModel, table: pl.DataFrame) -> None:
        columns = [c for c in table.columns if table[c].dtype.is_numeric()]
        if not columns:
            has = ", ".join(table.columns)
            raise ValueError(f"no column of the log holds numbers; it has {has}")
        self._model, self._table = model, table
        self._joints, actuators = names_of(model, "joint"), names_of(model, "actuator")
        on = (joint_of_actuator(model, a) for a in range(model.nu))
        moved = ["" if joint is None else self._joints[joint] for joint in on]
        self._moved = dict(zip(actuators, moved, strict=True))
        self.time = next((c for c in columns if _tokens(c) & TIMES), columns[0])
        times = table[self.time].drop_nulls().to_numpy().astype(float)
        step = float(np.median(np.diff(times)))
        self.time_unit = next((unit for unit, least in PERIODS if step >= least), "s")
        single = [n for j, n in enumerate(self._joints) if model.jnt_type[j] not in WIDTH]
        left = [c for c in columns if c != self.time]
        self.weld, self.measured = [n for n in self._joints if n not in single], {}
        free = [n for n in self.weld if model.jnt_type[self._joints.index(n)] == FREE]
        alone = free or self.weld  # a pose without a name is that of the base, if there is one
        tries = [(joint, False) for joint in self.weld]
        tries += [(joint, True) for joint in alone if len(alone) == 1]
        for joint, nameless in tries:
            if joint in self.weld and (pose := self._pose(joint, left, nameless)):
                self.weld.remove(joint)
                self.measured |= pose
                left = [c for c in left if c not in [column for column, _ in pose.values()]]
        kinds = {c: _kind(c, self._joints, actuators) for c in left}
        by_kind = {kind: [c for c in left if kinds[c] == kind] for kind in WORDS}
        for kind in ("position", "velocity"):
            for joint, column in _assigned(by_kind[kind], {n: [n] for n in single}).items():
                unit = self._unit(joint, column, kind)
                self.measured[f"joint[{joint}].{kind}"] = (column, unit)
        self.drive, follows = {}, {}
        for target, column in self._driven(by_kind, single).items():
            unit, follows[target] = self._drive_unit(target, column)
            self.drive[target] = (column, unit)
        usual = next(filter(None, follows.values()), "")
        self.servos = [t for t, unit in follows.items() if usual and unit is not None]
        for target in self.servos:  # one that stood still has the unit of the others
            self.drive[target] = (self.drive[target][0], follows[target] or usual)
        if len(self.servos) == model.nu > 1:
            self.servos = ["actuator[*]"]
        used = {column for column, _ in (*self.drive.values(), *self.measured.values())}
        for i, sensor in enumerate(names_of(model, "sensor")):
            size = int(model.sensor_dim[i])
            for end in [""] if size == 1 else [f"[{k}]" for k in range(size)]:
                if (column := f"{sensor}{end}") in left and column not in used:
                    self.measured[f"sensor[{sensor}]{end}"] = (column, "")
                    used.add(column)
        self.unused = [c for c in left if c not in used]
        unseen = [n for n in single if f"joint[{n}].position" not in self.measured]
        at = {int(model.jnt_qposadr[self._joints.index(name)]) for name in unseen}
        lacking = Followers(model, {*range(model.nq)} - at).lacking
        self.unmeasured = [name for name in unseen if self._joints.index(name) in lacking]
        self.follow = [name for name in unseen if name not in self.unmeasured]

    def _pose(self, joint: str, columns: Sequence[str], alone: bool) -> dict[str, tuple[str, str]]:
        """Return target → column, unit of a free or a ball joint's position, or nothing.

        Where it is `alone`, columns need not be called after it.
        """
        model, number = self._model, self._joints.index(joint)
        names = joint, names_of(model, "body")[int(model.jnt_bodyid[number])]
        words = [_tokens(n) for n in names if not n.isdigit()]
        own = [c for c in columns if any(some <= _tokens(c) for some in words)]
        own = [c for c in own or (columns if alone else ()) if not _tokens(c) & RATES]
        own.sort(key=lambda c: len(_tokens(c)))  # x before mag_x
        wanted = [({axis}, False) for axis in PLACE if model.jnt_type[number] == FREE]
        wanted += [({axis, f"q{axis}"}, True) for axis in AXES]
        found = [
            [c for c in own if axis & _tokens(c) and bool(_tokens(c) & TURNS) == turns]
            for axis, turns in wanted
        ]
        if not all(found):
            return {}
        at, units = f"joint[{joint}].position", [("m",), ()]
        return {
            f"{at}[{k}]": (some[0], _named_unit(some[0], joint, *units[turns]))
            for k, (some, (_, turns)) in enumerate(zip(found, wanted, strict=True))
        }

    def _driven(self, by_kind: Mapping[str, list[str]], single: Sequence[str]) -> dict[str, str]:
        """Match commands to actuators; else commanded torques, else measured ones, to joints.

        Of a joint the torque is its motor's, whose limits then count, if the motor's control is
        that torque; else the joint's itself. An actuator on no joint has its own.
        """
        model, moved = self._model, self._moved
        found = _assigned(by_kind["command"], {name: [name, on] for name, on in moved.items()})
        if found:
            others = {name: [name, on] for name, on in moved.items() if name not in found}
            found |= _called_alike(by_kind["torque"], others)
            return {f"actuator[{name}]": column for name, column in found.items()}
        place = {name: f"joint[{name}].torque" for name in single}
        for a, (name, on) in enumerate(moved.items()):
            if on in place and _control(model, a) in TORQUES and model.actuator_gear[a, 0] == 1:
                place[on] = f"actuator[{name}]"
        of_actuator = {name: place.get(on, f"actuator[{name}]") for name, on in moved.items()}
        called: dict[str, list[str]] = {}
        for name, target in (*place.items(), *of_actuator.items()):
            called.setdefault(target, []).append(name)
        commanded = [c for c in by_kind["torque"] if _tokens(c) & KINDS["command"]]
        columns = commanded or by_kind["torque"]
        in_order = of_actuator if len(columns) == model.nu else place
        return _assigned(columns, called, list(dict.fromkeys(in_order.values())))

    def _drive_unit(self, target: str, column: str) -> tuple[str, str | None]:
        """Return the unit of a column that drives, nothing where it is that of the actuator.

        Then, of a motor's column that is no torque, the unit of the position that its joint
        follows: nothing where nobody can tell, and None where the column can be no position.
        """
        kind, name = target.removesuffix(".torque")[:-1].split("[", 1)
        if kind == "joint":
            si = "N m" if self._length(name) == "rad" else "N"
            return _named_unit(column, name, si, "A") or si, None
        si, on = _control(self._model, list(self._moved).index(name)), self._moved[name]
        place, unit = self.measured.get(f"joint[{on}].position", ("", ""))
        kinds = (*TORQUES, "A") if si in TORQUES else (si,) if si else ()
        named = _named_unit(column, f"{name} {on}", *kinds)
        if named or not place or si not in ("rad", *TORQUES):
            return named, None
        length = self._length(on)
        commanded, measured = self._numbers(column), self._numbers(place) * UNITS[length][unit]
        if si == "rad":
            far = np.nanstd(commanded) > MORE * np.nanstd(measured) > 0
            return "deg" if far else "", None
        if _tokens(column) & KINDS["torque"]:
            return "", None
        named = _named_unit(column, f"{name} {on}", length)
        if self._model.jnt_stiffness[self._joints.index(on)] > 0:  # torques move it so, too
            return "", named
        for one in [named] if named else [unit, length, *(["deg"] * (length == "rad"))]:
            off = commanded * UNITS[length][one] - measured
            if np.nanvar(off) < AS_COMMANDED * np.nanvar(measured):
                return "", one
        return "", ""

    def _unit(self, joint: str, column: str, kind: str) -> str:
        """Return the unit of a position or a velocity: as the column is named, or by its size."""
        per, length = "" if kind == "position" else "/s", self._length(joint)
        named = _named_unit(column, joint, f"{length}{per}")
        if named or length == "m":
            return named or f"m{per}"
        values, number = self._numbers(column), self._joints.index(joint)
        times_s = self._numbers(self.time) * UNITS["s"][self.time_unit]
        most = float(np.nanmax(np.abs(values), initial=0.0))
        if per:
            place, unit = self.measured.get(f"joint[{joint}].position", ("", "rad"))
            if not place:
                return "deg/s" if most > FAST else "rad/s"
            seen = np.isfinite(turned := self._numbers(place) * UNITS["rad"][unit])
            rate = np.gradient(turned[seen], times_s[seen]) if seen.sum() > 1 else np.zeros(1)
            return "deg/s" if np.nanstd(values) > MORE * np.std(rate) else "rad/s"
        if self._model.jnt_limited[number]:
            far = most > max(FAR, 2 * np.abs(self._model.jnt_range[number]).max())
        else:
            far = most > FAR and _too_fast(self._model, number, values, times_s)
        return "deg" if far else "rad"

    def _length(self, joint: str) -> str:
        return "rad" if is_hinge(self._model, self._joints.index(joint)) else "m"

    def _numbers(self, column: str) -> np.ndarray:
        return self._table[column].cast(pl.Float64).fill_null(np.nan).to_numpy()


def _control(model: mujoco.MjModel, actuator: int) -> str:
    """Return the SI unit of a control, empty where it is no position, speed, torque or force."""
    gain, bias = model.actuator_gainprm[actuator], model.actuator_biasprm[actuator]
    plain = model.actuator_gaintype[actuator] == int(mujoco.mjtGain.mjGAIN_FIXED)
    joint = joint_of_actuator(model, actuator)
    hinge = joint is not None and is_hinge(model, joint)
    pulls = model.actuator_trntype[actuator] == int(mujoco.mjtTrn.mjTRN_TENDON)
    if not plain or model.actuator_dyntype[actuator] == int(mujoco.mjtDyn.mjDYN_INTEGRATOR):
        return ""
    if model.actuator_biastype[actuator] == int(mujoco.mjtBias.mjBIAS_NONE):
        return ("N m" if hinge else "N") if gain[0] == 1 else ""
    if (joint is None and not pulls) or gain[0] not in (-bias[1], -bias[2]):
        return ""
    return ("rad" if hinge else "m") + ("" if bias[1] else "/s")


def _tokens(name: str) -> set[str]:
    apart = re.sub(r"([a-z])([A-Z0-9])", r"\1 \2", name.replace("_mA", "_ma"))
    return {token.lower() for token in re.split(r"[^A-Za-z0-9]+", apart) if token}


def _kind(column: str, joints: Sequence[str], actuators: Sequence[str]) -> str | None:
    """Return what a column seems to hold.

    One that is called as a joint is its position, as an actuator its command; a unit may follow.
    """
    if column in joints or column in actuators:
        return "position" if column in joints else "command"

    def more(names: Sequence[str]) -> set[str]:
        return tokens - set[str]().union(*(_tokens(n) for n in names if _tokens(n) < tokens))

    tokens = _tokens(column)
    said = more(joints) or tokens  # a joint may be called pos_1
    if said == tokens and column.endswith("V") and more(actuators) == {"v"}:
        return "command"  # in volts
    for kind, words in KINDS.items():
        if said & words:
            return kind
    if said <= LENGTHS and said < tokens:
        return "position"
    if said & FORCES and said <= {*FORCES, "m", "k"} and said < tokens:
        return "torque"
    if re.search("_m?A$", column) and "a" not in set[str]().union(*map(_tokens, joints)):
        return "torque"  # a current
    return "command" if more(actuators) < tokens and more(actuators) <= {*ANY, *VOLTS} else None


def _assigned(
    columns: Sequence[str], called: Mapping[str, Sequence[str]], in_order: Sequence[str] = ()
) -> dict[str, str]:
    """Match columns to things by what these are called, else in order where there are enough.

    Those left over are matched in order where they are as many and all pairs share a word, or a
    number: q1 and J1.
    """
    found, order = _called_alike(columns, called), in_order or list(called)
    if not found and len(columns) >= len(order):
        return dict(zip(order, columns, strict=False))
    things = [thing for thing in order if thing not in found]
    left = [column for column in columns if column not in found.values()]
    pairs = dict(zip(things, left, strict=False)) if len(things) == len(left) else {}
    words = ([{*re.findall(r"[a-z]+|\d+", n.lower())} for n in pair] for pair in pairs.items())
    alike = all(one & other for one, other in words)
    return found | pairs if alike else found


def _called_alike(columns: Sequence[str], called: Mapping[str, Sequence[str]]) -> dict[str, str]:
    """Match columns to things by what these are called; to none where two have one column."""
    found = {}
    for thing, names in called.items():
        words = [_tokens(n) for n in names if n and not n.isdigit()]
        same = [c for c in columns if any(some <= _tokens(c) for some in words)]
        if same:  # the shortest: wrist before wrist_roll
            found[thing] = min(same, key=lambda c: len(_tokens(c)))
    return found if len(set(found.values())) == len(found) else {}


def _named_unit(column: str, name: str, *kinds: str) -> str:
    """Return the unit of some kind that a column's name holds beside a thing's name, or nothing."""
    words = _tokens(column) | set(re.split(r"[^a-z0-9]+", column.lower()))
    words = {re.sub("^(deg|rad)(ree|ian)s?$", r"\1", w) for w in words - _tokens(name)}
    found = {w: SPELLED[kind][w] for kind in kinds for w in words if w in SPELLED[kind]}
    return found[max(found, key=len)] if found else ""  # mNm before m and Nm


def _too_fast(model: mujoco.MjModel, joint: int, values: np.ndarray, times_s: np.ndarray) -> bool:
    """Tell whether gravity and drives could not turn a joint like that, read in radians.

    Of a balanced joint nobody can tell where drives have no range.
    """
    data, mass = mujoco.MjData(model), np.empty((model.nv, model.nv))
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, mass)
    body, dof = int(model.jnt_bodyid[joint]), int(model.jnt_dofadr[joint])
    lever_m = float(np.linalg.norm(data.subtree_com[body] - data.xanchor[joint]))
    weight = float(model.body_subtreemass[body] * np.linalg.norm(model.opt.gravity))
    driven = np.abs(model.actuator_gear[:, 0] * model.actuator_ctrlrange[:, 1])
    given = 2 * weight * lever_m + 2 * np.pi * float(driven.sum())  # others may push it
    speed = np.abs(values[8:] - values[:-8]) / (times_s[8:] - times_s[:-8])
    return 0 < TOO_MUCH * given < 0.5 * mass[dof, dof] * float(np.nanquantile(speed, 0.9)) ** 2


def _text(folder: Path, model_path: Path, logs: Sequence[Path], guess: _Guess) -> str:
    named = {f"{(p.parent.relative_to(folder) / '*').as_posix()}{p.suffix}" for p in logs}

    def lines(said: Mapping[str, tuple[str, str]]) -> str:
        rows = [
            f"  {target}: {{ column: {_quoted(column)}{f', unit: {unit}' if unit else ''} }}"
            for target, (column, unit) in said.items()
        ]
        return "\n".join(rows) or "  # nothing was recognised: add lines like those in docs"

    joint = next(iter(guess.measured), "joint[NAME].position").rpartition(".")[0]
    more = ""
    if guess.weld:
        more = f"weld: [{', '.join(map(_quoted, guess.weld))}]  # stays where the model puts it\n"
    if guess.servos:
        more += (
            "servos:  # commanded positions: the gains kp, kd with which the robot follows them\n"
        )
        more += "".join(f"  {_quoted(one)}: {{ kp: , kd: }}\n" for one in guess.servos)
    return (
        f"# Written by describe from {model_path.name} and {logs[0].name}: check columns, units.\n"
        f"model: {_quoted(model_path.relative_to(folder).as_posix())}\n"
        f"logs: [{', '.join(map(_quoted, sorted(named)))}]\n"
        f"time: {{ column: {_quoted(guess.time)}, unit: {guess.time_unit} }}\n"
        f"drive:  # what was commanded\n{lines(guess.drive)}\n"
        f"measured:\n{lines(guess.measured)}\n"
        f"{more}"
        "# tune:  # parameters that the nominal fit may change, with bounds; others are trusted\n"
        f"#   {joint}.damping: [0.0, 1.0]\n"
        "#   body[*].mass: { factor: [0.8, 1.2] }\n"
        + (
            f"# factors:  # what else may matter, such as {{ temperature: COLUMN }}; not used: "
            f"{', '.join(guess.unused)}\n"
            if guess.unused
            else ""
        )
    )


def _quoted(text: str) -> str:
    return text if re.fullmatch(r"[A-Za-z_][\w./-]*", text) else f'"{text}"'


def _remarks(log: Path, guess: _Guess) -> list[str]:
    said = [f"time is column {guess.time!r} in {guess.time_unit}"]
    for target, (column, unit) in {**guess.drive, **guess.measured}.items():
        said.append(f"{target} is column {column!r}{f' in {unit}' if unit else ''}")
    named = [joint for joint in guess.weld if not joint.isdigit()]
    base = [c for c in guess.unused if any(_tokens(w) <= _tokens(c) for w in named)]
    found = {
        "{}: motors of torque, but their columns are positions that the joints follow: write the "
        "gains of the robot's controller below servos": " and ".join(guess.servos),
        "{}: a free or a ball joint whose pose (x y z, quaternion) was not found in the log; it is "
        "taken to stay where the model puts it, as on a stand": ", ".join(guess.weld),
        "{} are not used: if the base moved, name its pose below measured": ", ".join(base),
        "no position was found for {}: name its column below measured, or put it into weld if it "
        "does not move": ", ".join(guess.unmeasured),
        "where {} stand follows from the measured joints, by the model's equalities": " and ".join(
            guess.follow
        ),
        "no column of {} looks like a command: name what drives the robot, if anything does": ""
        if guess.drive
        else log.name,
    }
    return said + [sentence.format(names) for sentence, names in found.items() if names]
