"""How large things usually are on a robot's logs, so that bounds of effects fit any robot."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from robotcast.robots.logs import Log, periods
from robotcast.robots.model_fields import loaded
from robotcast.robots.names import Channel, coordinates, loose, turning
from robotcast.robots.robot_file import RobotFile
from robotcast.robots.windows import StartStates

MOST_STATES, MANY_STATES = 200, 400
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
    """Root mean squares over the logs, (nv,) each.

    Attributes
    ----------
    torque : of what moves a joint and holds it, and of its own inertial torque.
    driven : the same, or what a joint is driven by where that is more: it may stick.
    position, speed : about the mean position, and of the speed.
    inertia : of a joint with all that hangs on it.
    lowest, highest : the range of positions.
    command : the largest that was commanded of every channel, (n_channels,).
    reach_m : how far the bodies' centres lie from the joints, the median.
    touches : whether anything touched anything.
    wave : length of a joint's motion after which the torque that the model lacks repeats, or NaN,
        and the cosine and the sine of a torque that would act so, (nv, 3).
    logs : how many there are.
    window_s : how long the windows are.
    """

    torque: np.ndarray
    speed: np.ndarray
    position: np.ndarray
    inertia: np.ndarray
    lowest: np.ndarray
    highest: np.ndarray
    hinge: np.ndarray
    command: np.ndarray
    log_s: float
    reach_m: float
    touches: bool
    driven: np.ndarray
    wave: np.ndarray
    logs: int
    window_s: float = np.inf

    def of(self, kind: str, dofs: Sequence[int], channels: Sequence[int]) -> tuple[float, str]:
        """Return the size of a kind over joints or channels, and its unit; of others 1."""
        if kind == "length":
            return self.reach_m, "m"
        if kind == "per command":
            return 1 / float(self.command[list(channels)].max()), "1"
        if kind not in SIZES:
            return 1.0, kind
        of_hinge, of_slide, size = SIZES[kind]
        at = list(dofs)
        return float(np.median(size(self)[at])), of_hinge if self.hinge[at[0]] else of_slide


def inverse_states(
    logs: Sequence[Log], starts: StartStates, most: int
) -> Iterator[tuple[int, int, np.ndarray, np.ndarray, np.ndarray]]:
    """Yield states that are spread over the logs: log, sample, qpos, qvel, qacc."""
    every, gap = max(1, sum(len(log.times_s) for log in logs) // most), starts.margin
    for index, log in enumerate(logs):
        for first in range(2 * gap, len(log.times_s) - 2 * gap, every):
            before, here, after = (starts.at(index, first + step) for step in (-gap, 0, gap))
            if before and here and after:
                span_s = log.times_s[first + gap] - log.times_s[first - gap]
                yield index, first, here[0], here[1], (after[1] - before[1]) / span_s


def driven(
    model: mujoco.MjModel, data: mujoco.MjData, channels: Iterable[Channel], commands: np.ndarray
) -> np.ndarray:
    """Return what commands (n_channels,) drive every degree of freedom by, at the state of data."""
    given = np.zeros(model.nv)
    for value, at in zip(commands, channels, strict=True):
        if at.dof is not None:
            given[at.dof] += value
        else:
            data.ctrl[at.actuator] = value
    mujoco.mj_forward(model, data)
    return given + data.qfrc_actuator


def sizes_of(robot: RobotFile, logs: Sequence[Log], starts: StartStates) -> Sizes:
    """Measure them by inverse dynamics on states that are spread over the logs.

    At a pose that is measured, what touches and what stops a joint may give any force: no more
    of it counts than nine of ten states stay below, of a free body none.
    """
    model, data = robot.model, mujoco.MjData(robot.model)
    qpos_of = coordinates(model)
    rows, touches = [], False
    mass = np.empty((model.nv, model.nv))
    for log, first, qpos, qvel, qacc in inverse_states(logs, starts, MOST_STATES):
        data.qpos[:], data.qvel[:], data.qacc[:] = qpos, qvel, qacc
        mujoco.mj_inverse(model, data)
        touches |= data.ncon > 0
        mujoco.mj_fullM(model, data, mass)
        own, held = np.diag(mass).copy(), data.qfrc_constraint.copy()
        needed = own * qacc, data.qfrc_inverse + held, held
        given = driven(model, data, robot.drive, logs[log].drive[first])
        rows.append((*needed, given, qvel, qpos[qpos_of], own))
    if not rows:
        raise ValueError("no state can be taken from the logs: too many samples are missing")
    parts = (np.array(part) for part in zip(*rows, strict=True))
    inertial, freely, held, given, speed, position, inertia = parts
    most = np.where(loose(model), 0.0, np.quantile(np.abs(held), OFTEN, axis=0))
    torque = np.hypot(inertial, freely - np.clip(held, -most, most))
    given = np.minimum(np.abs(given), np.quantile(np.abs(given), OFTEN, axis=0))
    own = inertia.mean(axis=0)

    def size(values: np.ndarray) -> np.ndarray:
        found = np.sqrt((values**2).mean(axis=0))
        return np.maximum(found, STILL * found.max() + 1e-12)

    usual, kinds = own * size(torque / own), model.jnt_type[model.dof_jntid]
    reach_m = np.linalg.norm(model.body_ipos[1:], axis=1)
    missing = [one.T for one in missing_torques(robot, logs, starts)]
    return Sizes(
        torque=usual,
        driven=np.maximum(usual, np.sqrt((given**2).mean(axis=0))),
        speed=size(speed),
        position=size(position - position.mean(axis=0)),
        inertia=own,
        lowest=position.min(axis=0),
        highest=position.max(axis=0),
        hinge=turning(model) | (kinds == int(mujoco.mjtJoint.mjJNT_HINGE)),
        command=np.maximum(np.max([np.abs(log.drive).max(axis=0) for log in logs], axis=0), 1e-9),
        log_s=max(log.times_s[-1] - log.times_s[0] for log in logs),
        reach_m=float(np.median(reach_m[reach_m > 0])) if (reach_m > 0).any() else 0.1,
        touches=touches,
        wave=np.array(
            [_wave(q, v, a, f, periods(logs)) for q, v, a, f in zip(*missing, strict=True)]
        ),
        logs=len(logs),
    )


def missing_torques(
    robot: RobotFile, logs: Sequence[Log], starts: StartStates
) -> tuple[np.ndarray, ...]:
    """Return what drove every joint less what it needed, by the model as it is, at many states.

    Positions, speeds, accelerations and those torques, (n, nv) each; positions of what turns about
    several axes are 0.
    """
    models = [loaded(robot.model, log.payloads) if log.payloads else robot.model for log in logs]
    data, rows = [mujoco.MjData(model) for model in models], []
    straight, at = ~turning(robot.model), coordinates(robot.model)
    for log, first, qpos, qvel, qacc in inverse_states(logs, starts, MANY_STATES):
        model, now = models[log], data[log]
        now.qpos[:], now.qvel[:], now.qacc[:] = qpos, qvel, qacc
        mujoco.mj_inverse(model, now)
        needed = now.qfrc_inverse.copy()
        given = driven(model, now, robot.drive, logs[log].drive[first])
        rows.append((straight * qpos[at], qvel, qacc, given - needed))
    return tuple(np.array(rows).swapaxes(0, 1))


def _wave(
    q: np.ndarray, v: np.ndarray, a: np.ndarray, lacks: np.ndarray, period_s: float
) -> tuple[float, float, float]:
    """Return the length [rad, m] after which what the model lacks of a joint repeats, NaN if none.

    And the cosine and the sine of a torque that would act so [N m, N].

    A sine of it explains most of `missing_torques` (n,) beside constant, spring, damping, friction
    and inertia, and more than noise does by chance (Scargle 1982, doi 10.1086/160554). Nothing
    shorter is looked for than twice what the joint usually passes between samples (Nyquist).
    """
    travel, least = np.ptp(q), 2 * np.sqrt((v**2).mean()) * period_s
    most = min(travel / least, MOST_WAVES) if least > 0 else 0.0
    if most <= WAVES:
        return np.nan, 0.0, 0.0
    base = np.linalg.qr(np.column_stack([np.ones(len(q)), q, v, np.sign(v), a]))[0]
    lacks = lacks - base @ (base.T @ lacks)
    tried, found = np.linspace(WAVES, most, int(FINE * most)), []
    for waves in tried:
        angle = 2 * np.pi * waves / travel * q
        pair = np.column_stack([np.cos(angle), np.sin(angle)])
        pair -= base @ (base.T @ pair)
        acts = -np.linalg.lstsq(pair, lacks, rcond=None)[0]
        share = ((pair @ acts) ** 2).sum() / (lacks @ lacks)
        found.append((share, travel / waves, *acts.tolist()))
    best = int(np.argmax([share for share, *_ in found]))
    if best == 0 or found[best][0] <= 2 * np.log(len(tried) / BY_CHANCE) / len(q):
        return np.nan, 0.0, 0.0
    return found[best][1:]
