"""How large things usually are on a robot's logs, so that bounds of effects fit any robot."""

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.optimize import nnls

from robotcast.robots.closure import ways
from robotcast.robots.couplings import tendon_arms
from robotcast.robots.logs import Log, periods
from robotcast.robots.model_fields import loaded
from robotcast.robots.names import coordinates, loose, turning
from robotcast.robots.robot_file import RobotFile
from robotcast.robots.transmission import FILTERS
from robotcast.robots.windows import StartStates

STATES = 400
OFTEN = 0.9  # of the states: forces of contacts and stops count up to what these stay below
STILL = 1e-3  # of the fastest joint, that one is taken to move by at least
WAVES, MOST_WAVES = 3, 2000  # over what a joint travels, of a torque that repeats with it
FINE = 8  # steps in which their number grows by one
BY_CHANCE = 0.01  # that noise seems to repeat
SIZES: dict[str, tuple[str, str, Callable[["Sizes"], np.ndarray]]] = {
    # its unit, of a hinge and of a slide, and what it is of each joint
    "torque": ("N m", "N", lambda usual: usual.torque),
    "speed": ("rad/s", "m/s", lambda usual: usual.speed),
    "position": ("rad", "m", lambda usual: usual.position),
    "damping": ("N m s/rad", "N s/m", lambda usual: usual.torque / usual.speed),
    "drag": ("N m s²/rad²", "N s²/m²", lambda usual: usual.torque / usual.speed**2),
    "stiffness": ("N m/rad", "N/m", lambda usual: usual.torque / usual.position),
    "compliance": ("rad/N m", "m/N", lambda usual: usual.position / usual.torque),
    "inertia": ("kg m²", "kg", lambda usual: usual.inertia),
    "per torque": ("1/(N m)", "1/N", lambda usual: 1 / usual.torque),
    "per speed": ("s/rad", "s/m", lambda usual: 1 / usual.speed),
}


@dataclass(frozen=True)
class Sizes:
    """Root mean squares over the logs, (nv,) each."""

    torque: np.ndarray  # of what moves a joint and holds it, and of its own inertial torque
    speed: np.ndarray
    position: np.ndarray  # about the mean
    inertia: np.ndarray  # of a joint with all that hangs on it
    # dry friction, damping and rotor inertia, by their effects' names, that tell most of what
    # drives a joint beyond what it needs
    lacks: Mapping[str, np.ndarray]
    lowest: np.ndarray  # and highest: the range of positions
    highest: np.ndarray
    hinge: np.ndarray
    command: np.ndarray  # the largest that was commanded of every channel, (n_channels,)
    log_s: float
    reach_m: float  # how far the bodies' centres lie from the joints, the median
    touches: bool  # whether anything touched anything
    driven: np.ndarray  # `torque`, or what a joint is driven by where that is more: it may stick
    # length of a joint's motion after which the torque that the model lacks repeats, or NaN, and
    # the cosine and the sine of a torque that would act so, (nv, 3)
    wave: np.ndarray
    logs: int  # how many there are
    arms: np.ndarray  # by how much tendons grow with joints, (ntendon, nv)
    factors: Mapping[str, tuple[float, float]]  # the least and the most of what else was logged
    period_s: float  # of the logs
    window_s: float = np.inf  # how long the windows are

    def of(
        self,
        kind: str,
        dofs: Sequence[int],
        channels: Sequence[int] = (),
        tendons: Sequence[int] = (),
    ) -> tuple[float, str]:
        """Return the size of a kind over joints, channels or tendons, and its unit; of others 1.

        A torque is a tendon's force by its arm. Tendons have lengths in m, but where they add up
        the positions of joints as they are.
        """
        if kind == "length":
            return self.reach_m, "m"
        if kind == "per command":
            return 1 / float(self.command[list(channels)].max()), "1"
        if kind not in SIZES:
            return 1.0, kind
        of_hinge, of_slide, size = SIZES[kind]
        at, own = list(dofs), size(self)
        if tendons:
            arms = np.abs(self.arms[list(tendons)])
            power = 1 if kind == "torque" else 2  # by speed or position, which the arm shortens
            own = own / np.where(arms > 0, arms, np.nan) ** power
            plain = bool(np.isin(arms, (0.0, 1.0)).all())
            return float(np.nanmedian(own)), of_hinge if plain and self.hinge[at[0]] else of_slide
        return float(np.median(own[at])), of_hinge if self.hinge[at[0]] else of_slide


@dataclass(frozen=True)
class Dynamics:
    """What the model as it is says of measured states, spread over the logs, (n, nv) each."""

    position: np.ndarray
    speed: np.ndarray
    acceleration: np.ndarray
    inertia: np.ndarray  # of a joint with all that hangs on it
    needed: np.ndarray  # what the motion takes beside `held`
    held: np.ndarray  # what touches and stops the joint
    given: np.ndarray  # what drove it
    touches: bool  # whether anything touched anything
    tied: np.ndarray  # whether equalities tie a joint to others, (nv,)

    @property
    def missing(self) -> np.ndarray:
        """What drove every joint less what it needed."""
        return self.given - self.needed


def dynamics(robot: RobotFile, logs: Sequence[Log], starts: StartStates) -> Dynamics:
    """Take states from the logs, and work out their dynamics.

    Of a joint that equalities tie to others, torques and inertia are those of all that it moves.
    Logs in which too many samples are missing are refused (ValueError).
    """
    at, touches, rows = coordinates(robot.model), False, []
    tied = np.zeros(robot.model.nv, bool)
    pose, way = mujoco.MjData(robot.model), np.eye(robot.model.nv)
    mass = np.empty_like(way)
    every, gap = max(1, sum(len(log.times_s) for log in logs) // STATES), starts.margin
    for index, log in enumerate(logs):
        model = loaded(robot.model, log.payloads) if log.payloads else copy(robot.model)
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_EQUALITY)
        data = mujoco.MjData(model)
        for first in range(2 * gap, len(log.times_s) - 2 * gap, every):
            before, here, after = (starts.at(index, first + step) for step in (-gap, 0, gap))
            if not (before and here and after):
                continue
            qpos, qvel = here[:2]
            qacc = (after[1] - before[1]) / (log.times_s[first + gap] - log.times_s[first - gap])
            data.qpos[:], data.qvel[:], data.qacc[:] = qpos, qvel, qacc
            mujoco.mj_inverse(model, data)
            mujoco.mj_fullM(model, data, mass)
            touches |= data.ncon > 0
            forces = np.array([data.qfrc_inverse, data.qfrc_constraint])
            forces = np.vstack([forces, _given(robot, data, log.drive[first])])
            inertia = np.diag(mass).copy()
            if model.neq:
                pose.qpos[:] = qpos
                mujoco.mj_fwdPosition(robot.model, pose)
                way = ways(robot.model, pose)
                tied |= (way != 0).sum(axis=1) > 1
                inertia, forces = np.diag(way @ mass @ way.T), forces @ way.T
            rows.append((qpos[at], qvel, qacc, inertia, *forces))
    if not rows:
        raise ValueError("no state can be taken from the logs: too many samples are missing")
    return Dynamics(*np.array(rows).swapaxes(0, 1), touches=touches, tied=tied)


def _given(robot: RobotFile, data: mujoco.MjData, commands: np.ndarray) -> np.ndarray:
    """Return what commands (n_channels,) drive every degree of freedom by, at the state of data."""
    given = np.zeros(data.model.nv)
    for value, at in zip(commands, robot.drive, strict=True):
        if at.dof is not None:
            given[at.dof] += value
        else:
            data.ctrl[at.actuator] = value
            if data.model.actuator_dyntype[at.actuator] in FILTERS:  # as if it had come long ago
                data.act[data.model.actuator_actadr[at.actuator]] = value
    mujoco.mj_forward(data.model, data)
    return given + data.qfrc_actuator


def sizes_of(robot: RobotFile, logs: Sequence[Log], starts: StartStates) -> Sizes:
    """Measure them by inverse dynamics on states that are spread over the logs.

    At a pose that is measured, what touches and what stops a joint may give any force: no more
    of it counts than nine of ten states stay below, of a free body none.
    """
    model, found = robot.model, dynamics(robot, logs, starts)
    most = np.where(loose(model), 0.0, np.quantile(np.abs(found.held), OFTEN, axis=0))
    moves = found.needed + found.held - np.clip(found.held, -most, most)
    torque = np.hypot(found.inertia * found.acceleration, moves)
    given = np.abs(found.given)
    given = np.minimum(given, np.quantile(given, OFTEN, axis=0))
    # where a tied joint hardly moves what moves others, these are as heavy as can be: no usual size
    mean = np.median if model.neq else np.mean
    own, position = mean(found.inertia, axis=0), found.position

    def size(values: np.ndarray) -> np.ndarray:
        found = np.sqrt(mean(values**2, axis=0))
        return np.maximum(found, STILL * found.max() + 1e-12)

    usual, kinds = own * size(torque / own), model.jnt_type[model.dof_jntid]
    reach_m = np.linalg.norm(model.body_ipos[1:], axis=1)
    by_joint = (position.T, found.speed.T, found.acceleration.T, found.missing.T)
    return Sizes(
        torque=usual,
        driven=np.maximum(usual, np.sqrt(mean(given**2, axis=0))),
        speed=size(found.speed),
        position=size(position - position.mean(axis=0)),
        inertia=own,
        lacks=_lacks(found, found.given - moves),
        lowest=position.min(axis=0),
        highest=position.max(axis=0),
        hinge=turning(model) | (kinds == int(mujoco.mjtJoint.mjJNT_HINGE)),
        command=np.maximum(np.max([np.abs(log.drive).max(axis=0) for log in logs], axis=0), 1e-9),
        log_s=max(log.times_s[-1] - log.times_s[0] for log in logs),
        reach_m=float(np.median(reach_m[reach_m > 0])) if (reach_m > 0).any() else 0.1,
        touches=found.touches,
        wave=np.array([_wave(*own, periods(logs)) for own in zip(*by_joint, strict=True)]),
        logs=len(logs),
        arms=tendon_arms(model),
        period_s=periods(logs),
        factors={
            name: (float(values.min()), float(values.max()))
            for name in robot.factors
            for values in [np.concatenate([log.factors[name] for log in logs])]
        },
    )


def _lacks(of: Dynamics, surplus: np.ndarray) -> dict[str, np.ndarray]:
    """Return friction and inertia, (nv,) each, that explain a surplus of drive (n, nv) best.

    Least squares of inverse dynamics beside a constant, none negative (as Atkeson, An and
    Hollerbach 1986, doi 10.1177/027836498600500306, take the inertia of links and loads). Of a
    joint that stands still nothing is seen, and of tied ones not whose it is: 0.
    """
    found, speed = np.zeros((3, len(of.tied))), np.sqrt((of.speed**2).mean(axis=0))
    for dof in np.flatnonzero((speed > STILL * speed.max()) & ~of.tied):
        v, a, own = (some[:, dof] for some in (of.speed, of.acceleration, surplus))
        slopes = np.column_stack([np.sign(v), v, a])
        found[:, dof] = nnls(slopes - slopes.mean(axis=0), own - own.mean())[0]
    return dict(zip(("dry_friction", "viscous_friction", "armature"), found, strict=True))


def _wave(
    q: np.ndarray, v: np.ndarray, a: np.ndarray, lacks: np.ndarray, period_s: float
) -> tuple[float, float, float]:
    """Return the length [rad, m] after which what the model lacks of a joint repeats, NaN if none.

    And the cosine and the sine of a torque that would act so [N m, N].

    A sine of it explains most of `Dynamics.missing` (n,) beside constant, spring, damping, friction
    and inertia, and more than noise does by chance (Scargle 1982, doi 10.1086/160554). Nothing
    shorter is looked for than twice what the joint usually passes between samples (Nyquist).
    """
    travel, least = np.ptp(q), 2 * np.sqrt((v**2).mean()) * period_s
    most = min(travel / least, MOST_WAVES) if least > 0 else 0.0
    if most <= WAVES:
        return np.nan, 0.0, 0.0
    base = np.linalg.qr(np.column_stack([np.ones(len(q)), q, v, np.sign(v), a]))[0]
    lacks = lacks - base @ (base.T @ lacks)

    def fitted(waves: np.ndarray) -> list[tuple[float, float, float, float]]:
        found = []
        for n in waves:
            angle = 2 * np.pi * n / travel * q
            pair = np.column_stack([np.cos(angle), np.sin(angle)])
            pair -= base @ (base.T @ pair)
            acts = -np.linalg.lstsq(pair, lacks, rcond=None)[0]
            share = ((pair @ acts) ** 2).sum() / (lacks @ lacks)
            found.append((share, n, *acts.tolist()))
        return found

    tried = np.linspace(WAVES, most, int(FINE * most))
    found = fitted(tried)
    best = int(np.argmax([share for share, *_ in found]))
    if best == 0 or found[best][0] <= 2 * np.log(len(tried) / BY_CHANCE) / len(q):
        return np.nan, 0.0, 0.0
    around = fitted(tried[best] + np.linspace(-1, 1, 4 * FINE + 1) * (tried[1] - tried[0]))
    _, waves, cosine, sine = max(around)
    return travel / waves, cosine, sine
