"""Cases of the benchmark of robots, drawn at random: mechanism, effect, place and size."""

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from mujoco.batch import SimulationError
from robot_truth import FINER, MECHANISMS, PERIOD_S, Hidden, Truth, make, rng_of, spec_of

from robotcast.robots.effect import RobotEffect
from robotcast.robots.effects import ModelField
from robotcast.robots.library import alone, candidates, library, parts_of
from robotcast.robots.logs import read_logs
from robotcast.robots.names import address, name_of_dof
from robotcast.robots.robot_file import RobotFile, read_robot
from robotcast.robots.sizes import Sizes, sizes_of
from robotcast.robots.transmission import is_servo, link_inertia
from robotcast.robots.windows import StartStates, noise_of

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
MOVES = 0.1  # times as far as without it, one joint in every log
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
        sizes = sizes_of(robot, logs, StartStates(robot, logs, noise_of(robot, logs)))
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
    truth = Truth(spec_of(hidden.mechanism), hidden, rng_of(hidden, seed))
    try:
        return truth.sines()[:, :, -len(truth.joints) :]
    except SimulationError:
        return np.array(np.nan)


def _fits(mechanism: str, shown: np.ndarray, before: np.ndarray, clean: np.ndarray) -> bool:
    """Tell whether a hidden effect shows, and the mechanism survives it and moves in every log."""
    k, noise = round(SHOWN_S / PERIOD_S), np.sqrt(13 / 12) * np.array(MECHANISMS[mechanism].quantum)
    low, high = clean.min(axis=(0, 1)), clean.max(axis=(0, 1))
    away = np.abs(shown - (low + high) / 2) / ((high - low) / 2)
    moves = np.ptp(shown, axis=1) > MOVES * np.ptp(clean, axis=1)
    if not (away < SURVIVES).all() or not moves.any(axis=1).all():
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
        parts = (parts_of(robot), alone(robot))
        whole, single = (candidates(robot, usual, some) for some in parts)
        self._effects = {
            e.name: e for e in (*whole, *single) if e.depends_on is None and not e.where.each
        }
        self._whole = [e.name for e in whole if e.depends_on is None]

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
            return self._law(kind, effect, size, unit) if len(joints) == 1 else None
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
            changed[at.name] = old * (1 + size) if effect.how[first] == "scale" else old + size
        return {"fields": changed, "sizes": sizes}

    def _law(
        self, kind: str, effect: RobotEffect, size: float, unit: Mapping[str, float]
    ) -> dict[str, Any] | None:
        """Return a friction law on one joint; None where it would be too steep for the truth."""
        (dof,), between, model = effect.where.dofs, self._between, self._robot.model
        law, force, name = {LAWS[kind]: size}, size, f"{effect.name}.{next(iter(unit))}"
        sizes = {name: size}
        if kind == "stribeck_friction":
            own = {"peak": size * between(1, 3), "speed": unit["speed"] * between(0.04, 0.2)}
            law, force = {**law, **own}, size + own["peak"]
            sizes |= {f"{effect.name}.peak": own["peak"]}
        elif kind == "load_friction":
            force = size * self._usual.torque[dof]
        step_s, speed = model.opt.timestep / FINER, self._usual.speed[dof]
        least = 1.5 * force * step_s / link_inertia(model, [dof])[0]  # that its steps can follow
        rate = max(0.004 * speed, least * (kind != "drag"))
        said = {"joint": name_of_dof(model, dof), **law, "rate": rate}
        return {"law": said, "sizes": sizes} if rate < speed / 30 else None
