"""What a robot's model may lack. conf/robot_effects.yaml gives each its parameters and bounds."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np

from robotcast.robots.effect import Motion, RobotEffect
from robotcast.robots.model_fields import ModelFields, spread
from robotcast.robots.names import Address, address, in_file, names_of
from robotcast.robots.transmission import drives_of, is_servo


class ModelField(RobotEffect):
    """An effect that MuJoCo has itself: numbers of the model are other ones.

    Each parameter `writes` fields of the part, "damping" or "ipos[0]": what it does, `how`, is to
    "add" the parameter, to "subtract" it, or to "scale" by 1 + it, for all or by name.
    """

    def __init__(
        self,
        *args: Any,
        writes: Mapping[str, Sequence[str]],
        how: str | Mapping[str, str] = "add",
        **more: Any,
    ) -> None:
        super().__init__(*args, **more)
        self.writes = {name: tuple(fields) for name, fields in writes.items()}
        self.how = dict.fromkeys(self.writes, how) if isinstance(how, str) else dict(how)

    def addresses(self, model: mujoco.MjModel) -> dict[str, list[Address]]:
        """Return what each parameter changes."""
        kind, numbers = self._objects(model)
        names, numbers = names_of(model, kind), list(dict.fromkeys(numbers))
        own = [p.name for p in self.parameters if p.name in self.writes]
        of = [[i] for i in numbers] if self.where.each else [numbers] * len(own)
        return {
            name: [
                self._own(address(model, f"{kind}[{names[i]}].{field}", self.name))
                for field in self.writes[name]
                for i in some
            ]
            for name, some in zip(own, of, strict=True)
        }

    def _own(self, at: Address) -> Address:
        """Return of an address the degrees of freedom that are meant: a free joint has several."""
        if not at.field.startswith("dof_"):
            return at
        return replace(at, rows=tuple(row for row in at.rows if row in self.where.dofs))

    def _objects(self, model: mujoco.MjModel) -> tuple[str, Sequence[int]]:
        """Return the kind and the numbers of what is changed; of the whole robot what may touch."""
        if self.where.tendons:
            return "tendon", self.where.tendons
        if self.part == "joint":
            return "joint", [int(model.dof_jntid[dof]) for dof in self.where.dofs]
        if self.part == "body":
            return "body", self.where.bodies
        if self.part == "drive":
            return "actuator", self.where.actuators
        touching = (model.geom_contype | model.geom_conaffinity) != 0
        return "geom", np.flatnonzero(touching).tolist()

    def write(self, fields: ModelFields, **values: np.ndarray) -> None:
        for name, some in self.addresses(fields.model).items():
            for at in some:
                if self.how[name] == "scale":
                    fields.multiply(at, 1 + values[name])
                else:
                    fields.add(at, values[name] if self.how[name] == "add" else -values[name])


class LinkPayload(ModelField):
    """A point mass on a link, `k` of the link's own; it moves the centre of both by x, y, z.

    So far away it lies at a distance, by which the inertia grows; it is no farther than the ranges
    of x, y and z allow.
    """

    def write(self, fields: ModelFields, *, k: np.ndarray, **moves: np.ndarray) -> None:
        body = self.where.bodies[0]
        own_kg = fields.field("body_mass")[:, body].copy()
        for name, (at,) in self.addresses(fields.model).items():
            if name == "k":
                fields.multiply(replace(at, along=()), 1 + k)
            else:
                fields.add(at, moves[name])
        moved_m, farthest_m = np.hstack(list(moves.values())), self.parameters[1].upper
        for sim in np.flatnonzero((k[:, 0] > 0) & moved_m.any(axis=1)):
            share = float(k[sim, 0] / (1 + k[sim, 0]))
            off_m = moved_m[sim] / share
            off_m *= min(1.0, farthest_m / float(np.linalg.norm(off_m)))
            spread(fields, int(sim), body, own_kg[sim] * share, off_m)


class Tilt(RobotEffect):
    """Gravity is turned by small angles about x and y, as if the base stood askew."""

    def write(self, fields: ModelFields, *, about_x: np.ndarray, about_y: np.ndarray) -> None:
        x, y, z = fields.model.opt.gravity
        more = (
            np.cos(about_y) * x + np.sin(about_y) * z - x,
            np.cos(about_x) * y - np.sin(about_x) * z - y,
        )
        for column, values in enumerate(more):
            fields.add(Address("option.gravity", "opt.gravity", (), column), values)


class DriveGain(RobotEffect):
    """Drives push (1 + k) times as hard as commanded: torque constants, gear ratios."""

    def write(self, fields: ModelFields, *, k: np.ndarray) -> None:
        rows = self.where.actuators
        if rows:
            for field, column in (("gainprm", 0), ("biasprm", 0), ("biasprm", 1), ("biasprm", 2)):
                at = Address(f"actuator.{field}", f"actuator_{field}", rows, column)
                fields.multiply(at, 1 + k)

    def command(self, drive: np.ndarray, step_s: float, *, k: np.ndarray) -> np.ndarray:
        return drive if self.where.actuators else drive * (1 + k)


class DeadTime(RobotEffect):
    """Commands act `tau` late."""

    def delay_s(self, *, tau: np.ndarray) -> np.ndarray:
        return tau

    def patch(self, spec: mujoco.MjSpec, model: mujoco.MjModel, *, tau: float) -> bool:
        for actuator in (spec.actuators[i] for i in self.where.actuators):
            actuator.delay += tau
            actuator.nsample = int(np.ceil(actuator.delay / model.opt.timestep)) + 2
        return bool(self.where.actuators)


class Lag(RobotEffect):
    """Commands act through a first-order filter of time constant `tau`."""

    def command(self, drive: np.ndarray, step_s: float, *, tau: np.ndarray) -> np.ndarray:
        lags = tau[:, 0] > 0
        keep = np.exp(-step_s / np.where(lags, tau[:, 0], 1.0))
        reached, out = drive[:, 0], np.empty_like(drive)
        for step in range(drive.shape[1]):
            wanted = drive[:, step]
            reached = np.where(lags, wanted + keep * (reached - wanted), wanted)
            out[:, step] = reached
        return out

    def patch(self, spec: mujoco.MjSpec, model: mujoco.MjModel, *, tau: float) -> bool:
        own = [spec.actuators[i] for i in self.where.actuators]
        if not own or any(a.dyntype != mujoco.mjtDyn.mjDYN_NONE for a in own):
            return False
        for actuator in own:
            actuator.dyntype = mujoco.mjtDyn.mjDYN_FILTEREXACT
            actuator.dynprm[0] = tau
        return True


def _limit(s: np.ndarray) -> np.ndarray:
    """Return 1/s, infinite at 0."""
    return np.where(s > 0, 1 / np.where(s > 0, s, 1.0), np.inf)


class CommandLimit(RobotEffect):
    """Drives follow commands up to ±1/s only: torque of a motor, position of a servo."""

    def command(self, drive: np.ndarray, step_s: float, *, s: np.ndarray) -> np.ndarray:
        return np.clip(drive, -_limit(s), _limit(s))

    def patch(self, spec: mujoco.MjSpec, model: mujoco.MjModel, *, s: float) -> bool:
        own = list(self.where.actuators)
        limited = model.actuator_ctrllimited[own].astype(bool)[:, None]
        ranges = np.where(limited, model.actuator_ctrlrange[own], np.inf * np.array([-1, 1]))
        ranges = np.clip(ranges, -1 / s, 1 / s)
        if not own or (ranges[:, 0] >= ranges[:, 1]).any():
            return False
        for i, bounds in zip(own, ranges.tolist(), strict=True):
            spec.actuators[i].ctrllimited = int(mujoco.mjtLimited.mjLIMITED_TRUE)
            spec.actuators[i].ctrlrange = bounds
        return True


class ForceLimit(RobotEffect):
    """Servos push with up to ±1/s only."""

    def write(self, fields: ModelFields, *, s: np.ndarray) -> None:
        rows = self.where.actuators
        limited = fields.model.actuator_forcelimited[list(rows)].astype(bool)
        for column, sign, bound in ((0, -1.0, np.maximum), (1, 1.0, np.minimum)):
            at = Address("actuator.forcerange", "actuator_forcerange", rows, column)
            known = np.where(limited, at.nominal(fields.model), sign * np.inf)
            fields.set(at, bound(known, sign * _limit(s)))

    def patch(self, spec: mujoco.MjSpec, model: mujoco.MjModel, *, s: float) -> bool:
        for i in self.where.actuators:
            spec.actuators[i].forcelimited = int(mujoco.mjtLimited.mjLIMITED_TRUE)
        return True


class CommandRate(RobotEffect):
    """Servos follow commands that change by up to 1/s a second only: a limit of their speed."""

    def command(self, drive: np.ndarray, step_s: float, *, s: np.ndarray) -> np.ndarray:
        limits = s[:, 0] > 0
        most = np.where(limits, step_s / np.where(limits, s[:, 0], 1.0), np.inf)
        reached, out = drive[:, 0], np.empty_like(drive)
        for step in range(drive.shape[1]):
            wanted = drive[:, step]
            near = reached + np.clip(wanted - reached, -most, most)
            reached = out[:, step] = np.where(limits, near, wanted)
        return out


class SpeedLimit(RobotEffect):
    """Motors push no faster than ±1/s: from 0.8/s on their torque fades."""

    def force(self, motion: Motion, *, s: np.ndarray) -> np.ndarray:
        along = np.sign(motion.torque) * motion.qvel * s
        return -motion.torque * np.clip((along - 0.8) / 0.2, 0.0, 1.0)


class Stribeck(RobotEffect):
    """Dry friction that is larger near rest: torque + peak · exp(−(v / speed)²)."""

    def friction(
        self, motion: Motion, *, torque: np.ndarray, peak: np.ndarray, speed: np.ndarray
    ) -> np.ndarray:
        return torque + peak * np.exp(-((motion.qvel / speed) ** 2))


class LoadFriction(RobotEffect):
    """Dry friction that grows with the torque that a joint carries, as in gears."""

    def friction(self, motion: Motion, **mu: np.ndarray) -> np.ndarray:
        return np.hstack(list(mu.values())) * np.abs(motion.torque)


class ConstantTorque(RobotEffect):
    """A torque that is always there: one on all joints, or one on each axis of a free motion."""

    def force(self, motion: Motion, **torques: np.ndarray) -> np.ndarray:
        return np.hstack(list(torques.values())) + 0.0 * motion.qpos


class Spring(RobotEffect):
    """A spring, or a cable that pulls: −k q + bias."""

    def force(self, motion: Motion, *, k: np.ndarray, bias: np.ndarray) -> np.ndarray:
        return bias - k * motion.qpos

    def patch(self, spec: mujoco.MjSpec, model: mujoco.MjModel, *, k: float, bias: float) -> bool:
        joints = [spec.joints[int(model.dof_jntid[dof])] for dof in self.where.dofs]
        if k == 0 or any(joint.stiffness[0] for joint in joints):
            return False
        for joint in joints:
            joint.stiffness[0], joint.springref = k, in_file(spec, joint, bias / k)
        return True


class EarlyCommand(RobotEffect):
    """Commands act `tau` before their time stamps."""

    def delay_s(self, *, tau: np.ndarray) -> np.ndarray:
        return -tau


class Clock(RobotEffect):
    """The clock of the logs runs 1 + k times as fast as time."""

    def pace(self, *, k: np.ndarray) -> np.ndarray:
        return 1 + k


class EncoderLatency(RobotEffect):
    """What the encoder shows is `tau` old."""

    def latency_s(self, *, tau: np.ndarray) -> np.ndarray:
        return tau


class Encoder(RobotEffect):
    """The encoder shows a + b q of a position q, to the log and to servos of the joint alike."""

    def closes(self, model: mujoco.MjModel, bias: np.ndarray, **values: np.ndarray) -> None:
        at_0, at_1 = (self.seen(np.full((len(bias), 1), q), **values)[:, 0] for q in (0.0, 1.0))
        for a in (a for dof in self.where.dofs for a in drives_of(model, dof)):
            if is_servo(model, a):
                bias[:, a, 0] += bias[:, a, 1] * model.actuator_gear[a, 0] * at_0
                bias[:, a, 1:3] *= (at_1 - at_0)[:, None]


class EncoderOffset(Encoder):
    """The encoder's zero is off by `q0`."""

    def seen(self, qpos: np.ndarray, *, q0: np.ndarray) -> np.ndarray:
        return qpos + q0

    def unseen(self, qpos: np.ndarray, *, q0: np.ndarray) -> np.ndarray:
        return qpos - q0

    def patch(self, spec: mujoco.MjSpec, model: mujoco.MjModel, *, q0: float) -> bool:
        """Let the joints count from where their encoders do."""
        by_tendon = model.actuator_trntype == int(mujoco.mjtTrn.mjTRN_TENDON)
        if spec.keys or np.any([*by_tendon, *model.tendon_limited, *model.tendon_stiffness]):
            return False  # a keyframe's positions and tendons' lengths would be others
        for dof in self.where.dofs:
            joint = spec.joints[int(model.dof_jntid[dof])]
            off = in_file(spec, joint, q0)
            joint.ref, joint.springref = joint.ref + off, joint.springref + off
            if joint.range[0] < joint.range[1]:
                joint.range = joint.range + off
        return True


class EncoderScale(Encoder):
    """The encoder shows 1 + k times the angle."""

    def seen(self, qpos: np.ndarray, *, k: np.ndarray) -> np.ndarray:
        return qpos * (1 + k)

    def unseen(self, qpos: np.ndarray, *, k: np.ndarray) -> np.ndarray:
        return qpos / (1 + k)


class Field(RobotEffect):
    """A flexible field that depends on one quantity, piecewise linear between knots.

    It is a field `of` "position", "speed", "torque", "time", "log" or "by_" and the name of a
    factor that was logged, with a parameter at each knot
    (n,): of one curve for all joints, or of one after the other for each. What repeats ends as it
    began, so that its last knot, a wave from the first, has no parameter.
    """

    def __init__(
        self,
        *args: Any,
        of: str,
        knots: np.ndarray,
        repeats: bool = False,
        guess: np.ndarray | None = None,
        **more: Any,
    ) -> None:
        super().__init__(*args, **more)
        self.of, self.knots, self.repeats, self.guess = of, knots, repeats, guess

    def table(self, values: np.ndarray) -> np.ndarray:
        """Return parameters (n_sim, n) as the curves' values at the knots, (n_sim, n_curves, n)."""
        table = values.reshape(len(values), -1, len(self.knots) - self.repeats)
        return np.dstack([table, table[:, :, :1]]) if self.repeats else table

    def curve(self, motion: Motion, values: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return the field's value at every joint, (n_sim, n_dofs)."""
        here = {
            "position": motion.qpos,
            "speed": motion.qvel,
            "torque": motion.torque,
            "time": motion.log_time_s,
        }
        at = here[self.of] if self.of in here else motion.slow[self.of]
        return self.value(np.broadcast_to(at, motion.qpos.shape), values)

    def value(self, at: np.ndarray, values: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return the field where what it depends on is `at`, (n_sim, n)."""
        if self.repeats:
            at = np.mod(at, self.knots[-1])
        table = self.table(np.hstack(list(values.values())))
        # of a run that diverges there is no place
        place = np.nan_to_num(np.interp(at, self.knots, np.arange(len(self.knots))))
        left = np.minimum(place.astype(int), len(self.knots) - 2)
        share = place - left
        own = np.arange(len(table))[:, None], np.arange(table.shape[1])
        return (1 - share) * table[*own, left] + share * table[*own, left + 1]


class TorqueField(Field):
    """Any torque that depends on one quantity."""

    def force(self, motion: Motion, **values: np.ndarray) -> np.ndarray:
        return self.curve(motion, values)


class FrictionField(Field):
    """Any dry friction that depends on one quantity."""

    def friction(self, motion: Motion, **values: np.ndarray) -> np.ndarray:
        return self.curve(motion, values)


class GainField(Field, DriveGain):
    """Drives push 1 + a curve times as hard: a battery that sags, a motor that warms up."""

    def in_window(self, slow: Mapping[str, np.ndarray], **values: np.ndarray) -> dict[str, Any]:
        return {"k": self.value(slow[self.of], values)}
