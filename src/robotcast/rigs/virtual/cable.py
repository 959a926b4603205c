"""The arm of the virtual rig and its cable, a three-dimensional chain on a real plane, in MuJoCo.

The cable is of another make than the simulators that are tuned: it lifts, sags and bounces, and the
board acts on it only through contacts. The arm lags; chance and resets scatter what both do.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import polars as pl

from robotcast.casts.action import ToolMotion
from robotcast.measurements.measurement_set import Cable


@dataclass(frozen=True)
class ArmDynamics:
    """A second-order lag with a gain error."""

    lag_s: float = 0.02  # by how much the tool follows late at constant speed
    damping: float = 0.9  # damping ratio
    gain_error: float = -0.004  # fraction by which the excursion from the start is too large

    def follow(self, planned: ToolMotion, t_s: np.ndarray, *, delay_s: float = 0.0) -> np.ndarray:
        """Return the pose (n, 3) of an arm that starts `delay_s` late, at evenly spaced `t_s`."""
        start = planned.pose[0]
        asked = start + (1 + self.gain_error) * (planned.at(t_s - delay_s) - start)
        # Bilinear transform of ω² / (s² + 2 ζ ω s + ω²), whose lag is 2 ζ / ω.
        k = 2 / (t_s[1] - t_s[0]) / (2 * self.damping / self.lag_s)
        middle = 2 * self.damping * k
        denominator = np.array([k * k + middle + 1, 2 - 2 * k * k, k * k - middle + 1])
        return lagged(np.array([1.0, 2.0, 1.0]), denominator, asked)


def lagged(numerator: np.ndarray, denominator: np.ndarray, asked: np.ndarray) -> np.ndarray:
    """Return what follows `asked` (n, k) in time, at rest before; coefficients of z⁰, z⁻¹ …"""
    from scipy.signal import lfilter, lfilter_zi  # half a second, for those who cast alone

    state = lfilter_zi(numerator, denominator)[:, None] * asked[0]
    return np.asarray(lfilter(numerator, denominator, asked, axis=0, zi=state)[0])


@dataclass(frozen=True)
class CastNoise:
    """Standard deviations of what changes from cast to cast."""

    friction: float = 0.015  # of the board's friction, relative
    tool_gain: float = 0.001  # of the arm's excursion, relative
    tool_delay_s: float = 0.002  # of the moment the arm starts
    tool_log_m: float = 0.0001  # of one logged tool sample
    tool_log_rad: float = 0.0005

    def draw(self, seed: int, number: int) -> tuple[float, float, float]:
        """Draw the friction's factor, the gain and the delay [s] of cast `number`."""
        friction, gain, delay = generator(seed, number, "cast").standard_normal(3).tolist()
        factor = float(np.exp(self.friction * friction))
        return factor, self.tool_gain * gain, abs(self.tool_delay_s * delay)


def generator(seed: int, number: int, purpose: str) -> np.random.Generator:
    """Return a generator that depends on the rig's seed, the cast's number and its use."""
    return np.random.default_rng(np.random.SeedSequence([seed, number, *purpose.encode()]))


@dataclass(frozen=True)
class StartScatter:
    """Headings of the cable after resets, as many were simulated (studies/resets)."""

    places: np.ndarray  # (p,), along the cable from 0 at the hand to 1 at the free end
    headings_rad: np.ndarray  # (resets, p), direction of the cable there; 0 is along +x

    def draw(self, segments: int, random: np.random.Generator) -> np.ndarray:
        """Draw headings (segments,) [rad] with the mean and covariance of the resets."""
        mean = self.headings_rad.mean(axis=0)
        spread = (self.headings_rad - mean) / np.sqrt(len(self.headings_rad) - 1)
        headings = mean + random.standard_normal(len(spread)) @ spread
        return np.interp((np.arange(segments) + 0.5) / segments, self.places, headings)


def packaged_path(cable_name: str) -> Path:
    return Path(__file__).parent / "scatter" / f"{cable_name}.csv"


def packaged_scatter(cable_name: str) -> StartScatter:
    path = packaged_path(cable_name)
    if not path.is_file():
        known = ", ".join(sorted(p.stem for p in path.parent.glob("*.csv")))
        raise ValueError(
            f"virtual rig: no resets were measured for {cable_name} (known: {known}); "
            f"python -m studies.resets.measure cable={cable_name} measures them"
        )
    table = pl.read_csv(path)
    columns = [name for name in table.columns if name.startswith("heading_")]
    places = np.array([float(name.removeprefix("heading_")) for name in columns])
    return StartScatter(places, table.select(columns).to_numpy())


TOOL_JOINTS = 5  # x, y, height, yaw and pitch of the held end
TOOL_ARMATURE = 1e3  # kg and kg m²: what the cable's pull cannot move
STEEPEST_RAD = 0.8
BOARD_BIT, CABLE_BIT = 1, 2

RECORD_S = 0.002
SETTLE_CAP_S = 1.0
REST_SPEED_M_S, REST_S = 0.005, 0.2


@dataclass(frozen=True)
class CableTruth:
    """What nobody can weigh: how the cable really bends and slides."""

    friction: float  # Coulomb coefficient of cable and endpoint on the board
    bending_stiffness_n_m2: float  # EI
    bending_damping_s: float  # Kelvin–Voigt time, moment = EI (κ + τ dκ/dt)
    hysteresis_n_m: float  # Coulomb moment that opposes bending
    tightest_bend_m: float  # smallest radius of curvature, where the cable's inside is squeezed
    endpoint_radius_m: float  # of the bright round weight at the free end
    segments: int = 30  # rigid pieces of the chain
    step_s: float = 0.001  # halving it moves the resting end by less than the resets scatter it
    contact_s: float = 0.003  # time constant of a contact


def build_cable(cable: Cable, truth: CableTruth) -> mujoco.MjSpec:
    """Return the held end, the chain and the board as an editable MuJoCo specification.

    `CableRun` moves the held end's joints; every segment hinges about z and about y against the one
    before. A third hinge is left out: the gripper keeps the cable from rolling about its own axis,
    which would let it cross the board without friction.
    """
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    # The pyramidal cone moves the resting end by 5–30 cm, the elliptic one is isotropic.
    option = spec.option
    option.timestep = truth.step_s
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.solver = mujoco.mjtSolver.mjSOL_CG
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = 5
    piece = spec.default.geom
    piece.type, piece.mass = mujoco.mjtGeom.mjGEOM_SPHERE, 0
    piece.contype, piece.conaffinity, piece.condim = CABLE_BIT, BOARD_BIT, 3
    piece.friction, piece.solref = [truth.friction, 0, 0], [truth.contact_s, 1]
    board = spec.worldbody.add_geom(name="board", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1])
    board.contype, board.conaffinity = BOARD_BIT, CABLE_BIT
    body = spec.worldbody.add_body(name="tool", pos=[0, 0, cable.radius_m], explicitinertial=True)
    body.mass, body.ipos, body.inertia = 1e-3, [0, 0, 0], [1e-6] * 3
    for axis in ([1, 0, 0], [0, 1, 0], [0, 0, 1]):
        body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis, armature=TOOL_ARMATURE)
    for axis in ([0, 0, 1], [0, 1, 0]):
        body.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=axis, armature=TOOL_ARMATURE)
    length, mass = cable.length_m / truth.segments, cable.mass_kg / truth.segments
    radius = cable.radius_m
    across = mass * (radius**2 / 4 + length**2 / 12)
    inertia = [mass * radius**2 / 2, across, across]
    for index in range(truth.segments):
        place = (length if index else 0.0, length / 2)
        body = add_piece(body, f"segment_{index}", place, mass, inertia, radius)
        _add_hinges(body, truth, length, first=index == 0)
    # A flat underside, level with the cable's. On a ball as thick as the weight is wide the end
    # would be held up and roll sideways, which drags it by 1–2 % of the cable's length a cast.
    mass = cable.endpoint_mass_kg
    inertia = [0.5 * mass * truth.endpoint_radius_m**2] * 3
    add_piece(body, "endpoint", (length, 0.0), mass, inertia, radius)
    return spec


def compile_cable(spec: mujoco.MjSpec) -> mujoco.MjModel:
    model = spec.compile()
    # MuJoCo scales its stopping rule by the mean inertia; with the tool's huge armature in it the
    # solver would stop early and the end would miss by centimetres.
    model.stat.meaninertia = 1e-3
    return model


def add_piece(
    parent: mujoco.MjsBody,
    name: str,
    place_m: tuple[float, float],
    mass_kg: float,
    inertia: list[float],
    radius_m: float,
) -> mujoco.MjsBody:
    """Add a body that touches the board with a ball about its centre of mass.

    `place_m` is where it begins on its parent's x axis, and where its centre is on its own.
    """
    begin, centre = ([along_m, 0, 0] for along_m in place_m)
    body = parent.add_body(name=name, pos=begin, explicitinertial=True, mass=mass_kg, ipos=centre)
    body.inertia = inertia
    body.add_geom(size=[radius_m, 0, 0], pos=centre)
    return body


def _add_hinges(body: mujoco.MjsBody, truth: CableTruth, length: float, *, first: bool) -> None:
    # Half a segment bends between the gripper and the first segment's middle.
    stiffness = truth.bending_stiffness_n_m2 / length * (2 if first else 1)
    widest = length / truth.tightest_bend_m
    # Lifted past a right angle a segment would point along the hinge about z and spin freely.
    for axis, limit in (([0, 0, 1], widest), ([0, 1, 0], min(widest, STEEPEST_RAD))):
        body.add_joint(
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=axis,
            stiffness=stiffness,
            damping=stiffness * truth.bending_damping_s,
            frictionloss=truth.hysteresis_n_m,
            limited=mujoco.mjtLimited.mjLIMITED_TRUE,
            range=[-limit, limit],
            solref_limit=[truth.contact_s / 2, 1],
        )


@dataclass(frozen=True)
class Motion:
    """What the cable did from the start of its path."""

    t_s: np.ndarray  # (n,), every `RECORD_S`
    nodes_m: np.ndarray  # (n, segments + 1, 3), from the held end to the free end

    @property
    def end_m(self) -> np.ndarray:
        return self.nodes_m[:, -1]  # (n, 3), of the free end


class CableRun:
    """One cable that is laid down along `headings_rad` (segments,) and driven by its held end.

    `held` (5,) is x, y, height above the resting height [m], yaw, pitch [rad] of that end;
    `disturb` is called before every step, to change the model or what acts on the cable.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        headings_rad: np.ndarray,
        held: np.ndarray,
        disturb: Callable[[mujoco.MjData], None] = lambda data: None,
    ) -> None:
        self.model, self.data = model, mujoco.MjData(model)
        self.disturb = disturb
        self._stride = max(1, round(RECORD_S / model.opt.timestep))
        self.data.qpos[:TOOL_JOINTS] = held
        hinges = slice(TOOL_JOINTS, TOOL_JOINTS + 2 * len(headings_rad), 2)
        self.data.qpos[hinges] = np.diff(headings_rad - held[3], prepend=0.0)
        mujoco.mj_forward(model, self.data)

    @property
    def held(self) -> np.ndarray:
        """Pose of the held end now, (5,) as in the constructor."""
        return self.data.qpos[:TOOL_JOINTS].copy()

    def settle(self) -> None:
        """Let the cable come to rest with the held end kept where it is."""
        steps = round(SETTLE_CAP_S / self.model.opt.timestep)
        self.drive(np.tile(self.held, (steps + 1, 1)), moving_s=0.0, start_s=-SETTLE_CAP_S)

    def drive(self, path: np.ndarray, *, moving_s: float, start_s: float = 0.0) -> Motion:
        """Move the held end along `path` and stop when the cable rests.

        `path` (steps + 1, 5) is the held end at every time step, its end the time cap; rest is not
        looked for before `moving_s`. The clock shows `start_s` at first, below zero before a cast.
        """
        model, data, dt = self.model, self.data, self.model.opt.timestep
        velocity = np.diff(path, axis=0) / dt
        recorded, resting_s = [nodes(model, data)], 0.0
        data.time = start_s
        for step in range(1, len(path)):
            # Impressed as a force: overwriting the pose would lose the cable's inertia.
            pull = (velocity[step - 1] - data.qvel[:TOOL_JOINTS]) / dt
            data.qfrc_applied[:TOOL_JOINTS] = TOOL_ARMATURE * pull
            self.disturb(data)
            mujoco.mj_step(model, data)
            if step % self._stride:
                continue
            recorded.append(nodes(model, data))
            speed = np.abs(recorded[-1] - recorded[-2]).max() / (self._stride * dt)
            resting_s = resting_s + self._stride * dt if speed < REST_SPEED_M_S else 0.0
            if resting_s >= REST_S and step * dt >= moving_s + REST_S:
                break
        bad = (f"mjWARN_BAD{of}" for of in ("QPOS", "QVEL", "QACC"))
        if any(data.warning[int(getattr(mujoco.mjtWarning, name))].number for name in bad):
            raise ValueError("virtual rig: the simulated cable diverged")
        return Motion(np.arange(len(recorded)) * self._stride * dt, np.stack(recorded))


def nodes(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """Return the chain's nodes (segments + 1, 3) [m] from the held end to the free end."""
    mujoco.mj_kinematics(model, data)  # a step leaves positions as they were before it
    first, last = model.body("segment_0").id, model.body("endpoint").id
    return data.xpos[first : last + 1].copy()
