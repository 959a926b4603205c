"""The candidates for one robot: every entry of conf/robot_effects.yaml on every part it fits."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import yaml

from robotcast.build import CONFIGURATION, build
from robotcast.fitting.parameter import Parameter
from robotcast.robots.couplings import tendon_parts
from robotcast.robots.effect import RobotEffect, Where
from robotcast.robots.effects import FrictionField, GainField, ModelField, TorqueField
from robotcast.robots.names import driven_dof, loose, name_of_dof, names_of, turning
from robotcast.robots.robot_file import RobotFile
from robotcast.robots.sizes import Sizes
from robotcast.robots.transmission import FILTERS, drives_of, is_plain, is_servo

FEW_JOINTS = 4  # up to as many, each is looked at alone; of more, groups of them
MANY_JOINTS = 8  # of more, a size for each is only looked at where one for all was named
FIELD_KNOTS = np.array([-2.0, -1.0, -0.4, 0.0, 0.4, 1.0, 2.0])
PLACES = 21  # of a field over the range of positions: ripple has several waves there
PHASES, TIMES = 9, 5  # of a field that repeats, and of one over the time
FIELDS = {  # what a field is, and what it depends on
    "speed": ("a {torque} on {joint} that depends on its speed", "the speed of {joint}"),
    "position": ("a {torque} on {joint} that depends on its position", "the position of {joint}"),
    "time": ("a {torque} on {joint} that depends on the time into the log", "time"),
    "torque": (
        "a {torque} on {joint} that depends on the {torque} it carries",
        "the {torque} of {joint}",
    ),
    "ripple": (
        "a {torque} on {joint} that repeats every {wave}",
        "the position of {joint} within {wave}",
    ),
    "log": ("friction in {joint} that changes from log to log", "{log}"),
    "warmth": ("friction in {joint} that changes within a log", "the time into the log"),
    "log_gain": ("a drive gain of {joint} that changes from log to log", "{log}"),
    "warmth_gain": ("a drive gain of {joint} that changes within a log", "the time into the log"),
}
BY = "{what} of {joint} that changes with {factor}"  # of what was logged, as a temperature
FRICTIONS = ("log", "warmth")
FEW_LOGS, MANY_LOGS = 3, 5  # from so many on there is a field of them, of no more knots than that
PROBE, BOUND = 0.1, 2.0  # of a field, in usual torques


def library() -> dict[str, dict[str, Any]]:
    """Return the entries of the library, by name."""
    return yaml.safe_load((CONFIGURATION / "robot_effects.yaml").read_text(encoding="utf-8"))


def candidates(
    robot: RobotFile, sizes: Sizes, parts: Mapping[str, Sequence[Where]]
) -> tuple[RobotEffect, ...]:
    """Make every effect of the library on these parts, and the fields that stand for anything."""
    found: list[RobotEffect] = []
    for name, entry in library().items():
        kinds = (entry["part"], *entry.get("also", ()))
        for where in (one for kind in kinds for one in parts.get(kind, ())):
            effect = _made(robot, name, entry, where, sizes)
            if isinstance(effect, ModelField):
                effect = _untuned(robot, effect)
            found += [effect] if effect else []
    joints = (*parts["joint"], *parts.get("free motion", ()))
    return (*found, *_fields(robot.model, joints, sizes))


def lacking(robot: RobotFile, sizes: Sizes) -> list[RobotEffect]:
    """Return the effects that inverse dynamics guess, each on every joint in a size of its own."""
    dofs = tuple(np.flatnonzero(~loose(robot.model)).tolist())
    where = replace(_where(robot, "every_joint", dofs), each=True)
    made = (_made(robot, name, library()[name], where, sizes) for name in sizes.lacks if dofs)
    return [one for one in made if one]


def alone(robot: RobotFile) -> Mapping[str, Sequence[Where]]:
    """Return the joints, links and drives that are parts of groups, or of none, each alone."""
    model, parts = robot.model, parts_of(robot)
    single = [one.dofs for one in parts["joint"]]
    dofs = [d for d in np.flatnonzero(~loose(model)).tolist() if (d,) not in single]
    joints = [_where(robot, name_of_dof(model, dof), (dof,)) for dof in dofs]
    others = [c for one in parts["drive"] if not one.dofs for c in one.channels]
    known = {b for one in parts["body"] for b in one.bodies}
    return {
        "joint": joints,
        "each joint": [w for w in _each(robot, parts["joint"]) if w not in parts["each joint"]],
        "drive": [*(one for one in joints if one.channels), *(_drive(robot, c) for c in others)],
        "body": [one for one in _links(model, model.dof_bodyid) if not known & {*one.bodies}],
        "tendon": [one for one in tendon_parts(model)["tendon"] if one not in parts["tendon"]],
    }


def parts_of(robot: RobotFile) -> Mapping[str, Sequence[Where]]:
    """Return the joints, links and drives that effects act on: each alone, or groups of them."""
    model, groups = robot.model, dict(robot.groups) or _groups(robot.model)
    joints = [_where(robot, name, dofs) for name, dofs in groups.items()]
    drives = [one for one in joints if one.channels]
    known = {c for one in joints for c in one.channels}
    others = [c for c in range(len(robot.drive)) if c not in known]
    drives += [_where(robot, "every_actuator", (), others)] if len(others) > 1 else []
    drives += [_drive(robot, c) for c in others] if len(others) <= FEW_JOINTS else []
    bodies = [int(model.dof_bodyid[dof]) for dof in range(model.nv)]
    if model.nv > FEW_JOINTS:  # loads hang on the last bodies, or on what moves freely
        free = {int(model.dof_bodyid[dof]) for dof in np.flatnonzero(loose(model))}
        carry = {int(model.body_weldid[model.body_parentid[b]]) for b in bodies}
        bodies = [b for b in bodies if b in free or b not in carry]
    driven = tuple(dict.fromkeys(dof for one in drives for dof in one.dofs))
    several = sum(bool(one.dofs) for one in drives) > 1
    lifted = tuple(b for b in np.unique(model.dof_bodyid).tolist() if model.body_gravcomp[b])
    return {
        "joint": joints,
        "each joint": [w for w in _each(robot, joints) if _differ(model, w.dofs)],
        **tendon_parts(model, FEW_JOINTS),
        **_free_parts(robot),
        "body": _links(model, bodies),
        "compensated": [Where("every_link", (), lifted, (), ())] if len(lifted) > 1 else [],
        "drive": drives,
        "every drive": [_where(robot, "every_joint", driven)] if several else [],
        "robot": [_where(robot, "", tuple(range(model.nv)), range(len(robot.drive)))],
    }


def _each(robot: RobotFile, joints: Iterable[Where]) -> list[Where]:
    """Return of groups of joints all that they have, each joint for itself."""
    short = {"all_hinges": "each_hinge", "all_slides": "each_slide"}
    long = "each_joint_of_{}" if robot.groups else "each_{}"
    several = (one for one in joints if len(one.dofs) > 1)
    return [replace(w, name=short.get(w.name, long.format(w.name)), each=True) for w in several]


def _depth(model: mujoco.MjModel, dof: int) -> int:
    """Return how many degrees of freedom carry one, and itself."""
    return 1 + _depth(model, int(model.dof_parentid[dof])) if dof >= 0 else 0


def _differ(model: mujoco.MjModel, dofs: Sequence[int]) -> bool:
    """Tell whether joints are few, and at other depths in the tree, as those of an arm are."""
    return len(dofs) <= MANY_JOINTS and len({_depth(model, dof) for dof in dofs}) > 1


def _links(model: mujoco.MjModel, bodies: Iterable[int]) -> list[Where]:
    names = names_of(model, "body")
    return [Where(names[b], (), (int(b),), (), ()) for b in dict.fromkeys(bodies)]


def _free_parts(robot: RobotFile) -> dict[str, list[Where]]:
    """Return free and ball joints: each as a whole, and the motions of its path and its turn."""
    model, turns = robot.model, turning(robot.model)
    whole, motions = [], []
    for joint in np.unique(model.dof_jntid[loose(model)]).tolist():
        own, name = np.flatnonzero(model.dof_jntid == joint), names_of(model, "joint")[joint]
        whole.append(_where(robot, name, tuple(own.tolist())))
        for what, some in (("path", own[~turns[own]]), ("turn", own[turns[own]])):
            motions += [_where(robot, f"{name}_{what}", tuple(some.tolist()))] if len(some) else []
    return {"free joint": whole, "free motion": motions}


def _groups(model: mujoco.MjModel) -> dict[str, tuple[int, ...]]:
    """Return each joint alone, of many those alike: as deep in the tree, as all knees are."""
    single = np.flatnonzero(~loose(model)).tolist()
    if len(single) <= FEW_JOINTS:
        return {name_of_dof(model, dof): (dof,) for dof in single}
    alike: dict[tuple[int, int], list[int]] = {}
    for dof in single:
        kind = int(model.jnt_type[model.dof_jntid[dof]]), _depth(model, dof)
        alike.setdefault(kind, []).append(dof)
    if len(alike) > FEW_JOINTS:  # a chain
        kinds = model.jnt_type[model.dof_jntid]
        found = {"all_hinges": np.flatnonzero(kinds == 3), "all_slides": np.flatnonzero(kinds == 2)}
        return {name: tuple(dofs.tolist()) for name, dofs in found.items() if len(dofs)}
    words = {dof: name_of_dof(model, dof).replace("-", "_").split("_") for dof in single}
    groups = alike.values()
    return {_common([words[d] for d in some], words.values()): tuple(some) for some in groups}


def _common(words: Sequence[Sequence[str]], others: Iterable[Sequence[str]]) -> str:
    """Return the words that all names share, "calf joint" of FL_calf_joint and RR_calf_joint.

    Where those are in all others, too, the first and the last name tell the group.
    """
    shared = [word for word in words[0] if all(word in other for other in words)]
    if all(word in other for word in shared for other in others):
        ends = words if len(words) < 3 else (words[0], ["to"], words[-1])
        shared = [word for end in ends for word in end]
    return "_".join(shared)


def _where(
    robot: RobotFile, name: str, dofs: tuple[int, ...], own: Sequence[int] | None = None
) -> Where:
    """Return a part by its joints, with the channels that drive them unless others are named."""
    model, channels = robot.model, list(robot.drive)
    if own is None:
        own = [c for c, at in enumerate(channels) if driven_dof(model, at) in dofs]
    bodies = tuple(dict.fromkeys(int(model.dof_bodyid[dof]) for dof in dofs))
    actuators = tuple(a for c in own if (a := channels[c].actuator) is not None)
    return Where(name, dofs, bodies, tuple(own), actuators)


def _drive(robot: RobotFile, channel: int) -> Where:
    """Return a drive that moves no single joint."""
    name = re.sub(r"\W+", "_", list(robot.drive)[channel].name).strip("_")
    return _where(robot, name, (), (channel,))


def _made(
    robot: RobotFile, name: str, entry: Mapping[str, Any], where: Where, sizes: Sizes
) -> RobotEffect | None:
    """Make one effect on one part, None where it cannot act there."""
    model = robot.model
    more = {k: v for k, v in entry.items() if k not in ("also", "text", "parameters", "needs")}
    dofs = where.dofs or tuple(range(model.nv))
    if not _needed(robot, entry.get("needs"), where, sizes):
        return None
    own_kg, links_kg = (
        float(model.body_mass[list(some)].max(initial=0.0))
        for some in (where.bodies, np.unique(model.dof_bodyid))
    )
    heaviest = links_kg / own_kg if own_kg > 0 else 0.0
    if "usual" in more:
        more["usual"] = sizes.of(more["usual"], dofs, where.channels)[0]
    guess = sizes.lacks.get(name)
    parts = [("", dofs)]
    if where.each:
        words = zip(_words(model, where.dofs), where.dofs, strict=True)
        parts = [(f"_{joint}", (dof,)) for joint, dof in words]
    parameters = [
        _parameter(n + joint, given, sizes, replace(where, dofs=own), heaviest, guess)
        for n, given in entry["parameters"].items()
        for joint, own in parts
    ]
    if where.each and "writes" in more:
        (written,) = more["writes"].values()
        more["writes"] = dict.fromkeys((p.name for p in parameters), written)
    effect = build(
        more,
        name=f"{name}_{where.name}" if where.name else name,
        text=entry["text"].format(where=where.name.replace("_", " ")),
        parameters=parameters,
        where=where,
    )
    _keep_physical(model, effect)
    if guess is not None and len(effect.parameters) == len(where.dofs):
        ends = np.array([[p.lower, p.upper] for p in effect.parameters]).T
        effect.guess = np.clip(guess[list(where.dofs)], *ends)
    return effect


def _words(model: mujoco.MjModel, dofs: Sequence[int]) -> list[str]:
    """Return joints' names without dots, which part effects from parameters, or their numbers."""
    found = [re.sub(r"\W+", "_", name_of_dof(model, dof)) for dof in dofs]
    return found if len({*found}) == len(found) else [str(dof) for dof in dofs]


def _needed(robot: RobotFile, what: str | None, where: Where, sizes: Sizes) -> bool:
    """Tell whether a part has what an effect needs.

    All encoders late are all drives late, so that latency needs others that are not. A servo's
    velocity gain is viscous friction, bit by bit, unless its force is limited.
    """
    model, own = robot.model, list(where.actuators)
    encoders = bool({*where.dofs} - {*robot.followers.dofs.tolist()})
    servo = bool(own) and all(is_servo(model, a) for a in own)
    driven = len(where.channels) >= len(where.dofs) > 0
    return {
        None: True,
        "gravity": bool(np.any(model.opt.gravity)),
        "drive": bool(where.channels),
        "encoder": encoders,
        "plain drive": driven
        and encoders
        and all(is_plain(model, a) for dof in where.dofs for a in drives_of(model, dof)),
        "motor": bool(where.dofs) and not servo,
        "servo": servo,
        "limited servo": servo and bool(model.actuator_forcelimited[own].all()),
        "filter": bool(own) and all(model.actuator_dyntype[a] in FILTERS for a in own),
        "others": encoders and len(where.dofs) < model.nv,
        "compensation": bool(model.body_gravcomp[list(where.bodies)].any()),
        "turning": any(_turns(model, b) for b in where.bodies),
        "contact": sizes.touches,
    }[what]


def _turns(model: mujoco.MjModel, body: int) -> bool:
    """Tell whether a body moves other than along slides, so that its centre of mass matters."""
    while body:
        if (model.jnt_type[model.jnt_bodyid == body] != mujoco.mjtJoint.mjJNT_SLIDE).any():
            return True
        body = int(model.body_parentid[body])
    return False


def _parameter(
    name: str,
    given: Mapping[str, Any],
    sizes: Sizes,
    where: Where,
    heaviest: float,
    guess: np.ndarray | None,
) -> Parameter:
    """Make a parameter whose numbers are in units of a usual size.

    A joint that sticks needs little torque to move as it does: what brakes it may be larger, up to
    what drives it; or twice what inverse dynamics `guess` (nv,). A light flange may carry as much
    as the `heaviest` link weighs, in its own masses; a first look at it is taken in between.
    What an encoder shows late moved before the window: so much of it is measured, not predicted.
    """
    on = given["of"], where.dofs, where.channels, where.tendons
    null = given.get("null_at")
    size, unit = sizes.of(*on)
    nominal = size * (given["nominal"] if null is None else null)
    lower = size * given["lower"]
    driven = replace(sizes, torque=sizes.driven).of(*on)[0]
    much = 0.0 if guess is None else float(np.median(guess[list(where.dofs)]))
    wide = max(1.0, much * given.get("of_guess", 0.0) / size / given["upper"])
    upper = size * wide * given["upper"]
    more = {"driven": driven, "heaviest": heaviest, "period": sizes.period_s}
    upper = max(upper, *(own * given.get(f"of_{what}", 0.0) for what, own in more.items()))
    if "of_heaviest" in given:
        wide = math.sqrt(upper / given["upper"])
    upper = min(upper, given.get("of_window", np.inf) * sizes.window_s)
    probes = tuple(size * p * (wide if p > 0 else 1.0) for p in given.get("probes", ()))
    probes = tuple(p for p in probes if p <= upper)
    null = None if null is None else nominal
    return Parameter(name, unit, lower, upper, nominal, null=null, probes=probes)


def _keep_physical(model: mujoco.MjModel, effect: RobotEffect) -> None:
    """Keep what is added to friction, damping and armature from making them negative."""
    if (
        not isinstance(effect, ModelField)
        or effect.part not in ("joint", "tendon")
        or "scale" in effect.how.values()
    ):
        return
    bounded = []
    for parameter in effect.parameters:
        least = min(at.nominal(model).min() for at in effect.addresses(model)[parameter.name])
        lower = max(parameter.lower, -float(least))
        probes = tuple(p for p in parameter.probes if p > lower)
        bounded.append(replace(parameter, lower=lower, probes=probes))
    effect.parameters = tuple(bounded)


def _untuned(robot: RobotFile, effect: ModelField) -> RobotEffect | None:
    """Return what of an effect the nominal fit leaves: all of it, some joints, or nothing.

    One number for several joints cannot do what each may have of its own.
    """
    tuned = {(t.at.field, t.at.rows, t.at.column, bool(t.at.along)) for t in robot.tune}
    left = []
    for name, some in effect.addresses(robot.model).items():
        places: dict[tuple[str, int | None, bool], list[int]] = {}
        for at in some:
            places.setdefault((at.field, at.column, bool(at.along)), []).extend(at.rows)
        alone = all(
            (at.field, (r,), at.column, bool(at.along)) in tuned for at in some for r in at.rows
        )
        whole = all((field, tuple(rows), *more) in tuned for (field, *more), rows in places.items())
        if not (whole or (alone and any(at.rows for at in some))):
            left.append(name)
    if not effect.where.each or len(left) == len(effect.parameters):
        return effect if left else None
    pairs = zip(effect.where.dofs, effect.parameters, strict=True)
    dofs = [dof for dof, p in pairs if p.name in left]
    return effect.of_joints(dofs, effect.where.name) if len(dofs) > 1 else None


def _fields(model: mujoco.MjModel, joints: Sequence[Where], sizes: Sizes) -> list[RobotEffect]:
    """Make the flexible fields of every joint, with a curve for each axis of a free motion."""
    found: list[RobotEffect] = []
    for where in joints:
        (torque, unit), (speed, _) = (sizes.of(s, where.dofs) for s in ("torque", "speed"))
        at, free = list(where.dofs), bool(loose(model)[list(where.dofs)].any())
        own = sizes.wave[at]
        (wave, *sine), hinge = own[np.argsort(own[:, 0])[len(at) // 2]].tolist(), unit == "N m"
        knots = {
            "speed": speed * FIELD_KNOTS,
            "position": np.linspace(sizes.lowest[at].min(), sizes.highest[at].max(), PLACES),
            "time": np.linspace(0.0, sizes.log_s, TIMES),
            "torque": torque * FIELD_KNOTS,
            "ripple": np.linspace(0.0, wave, PHASES),
            "log": np.linspace(1.0, sizes.logs, min(sizes.logs, MANY_LOGS)),
            "warmth": np.linspace(0.0, sizes.log_s, TIMES),
        }
        by = {f"by_{name}": np.linspace(*ends, TIMES) for name, ends in sizes.factors.items()}
        knots |= {name: places for name, places in by.items() if places[0] < places[-1]}
        slow = [*FRICTIONS, *by]
        knots |= {f"{name}_gain": knots[name] for name in slow if name in knots}
        lacks = {
            "position": turning(model)[at].any(),
            "torque": not where.channels,
            "ripple": free or np.isnan(wave),
            "log": free or sizes.logs < FEW_LOGS,
            "warmth": free,
        }
        lacks |= dict.fromkeys(by, free)
        lacks |= {f"{name}_gain": lacks[name] or not where.channels for name in slow}
        words = {
            "joint": where.name.replace("_", " "),
            "torque": "torque" if hinge else "force",
            "wave": f"{wave:.3g} rad, {2 * np.pi / wave:.3g} a turn" if hinge else f"{wave:.3g} m",
            "log": "the order of the logs" if sizes.logs > MANY_LOGS else "the log",
        }
        for name, places in knots.items():
            if lacks.get(name):
                continue
            kind, repeats = TorqueField, name == "ripple"
            if name.removesuffix("_gain") in slow:
                kind = GainField if name.endswith("_gain") else FrictionField
            usual, in_unit = (1.0, "1") if kind is GainField else (torque, unit)
            bound, own = BOUND * usual, float(model.dof_frictionloss[at].min())
            least = -min(bound, {FrictionField: own, GainField: 1.0}.get(kind, bound))
            n = (len(where.dofs) if free else 1) * (len(places) - repeats)
            one = Parameter("", in_unit, least, bound, 0.0, null=0.0, probes=(PROBE * usual,))
            own = [replace(one, name=f"c{k}") for k in range(n)]
            of = name.removesuffix("_gain")
            words |= {"factor": of.removeprefix("by_").replace("_", " ")}
            words |= {"what": "a drive gain" if kind is GainField else "friction"}
            text, depends_on = (part.format(**words) for part in FIELDS.get(name, (BY, "{factor}")))
            of = {"ripple": "position", "warmth": "time"}.get(of, of)
            more = {"of": of, "knots": places, "repeats": repeats}
            if repeats:
                angle = 2 * np.pi * places[:-1] / wave
                more["guess"] = sine[0] * np.cos(angle) + sine[1] * np.sin(angle)
            name = f"{name}_field_{where.name}"
            found.append(kind(name, text, own, where, depends_on=depends_on, **more))
    return found
