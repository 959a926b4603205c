"""The cable of the virtual rig: a three-dimensional chain on a real plane, in MuJoCo.

It is of another make than the simulators that are tuned: it lifts, sags and bounces, and the
board acts on it only through contacts.
"""

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from robotcast.measurements.measurement_set import Cable

TOOL_JOINTS = ("tool_x", "tool_y", "tool_z", "tool_yaw", "tool_pitch")
TOOL_ARMATURE = 1e3  # kg and kg m²: what the cable's pull cannot move
STEEPEST_RAD = 0.8
BOARD_BIT, CABLE_BIT = 1, 2


@dataclass(frozen=True)
class CableTruth:
    """What nobody can weigh: how the cable really bends and slides.

    Attributes
    ----------
    friction : Coulomb coefficient of cable and endpoint on the board.
    bending_stiffness_n_m2 : EI.
    bending_damping_s : Kelvin–Voigt time, moment = EI (κ + τ dκ/dt).
    hysteresis_n_m : Coulomb moment that opposes bending.
    tightest_bend_m : smallest radius of curvature, where the cable's inside is squeezed.
    endpoint_radius_m : of the bright round weight at the free end.
    segments : rigid pieces of the chain.
    step_s : time step; halving 1 ms moves the resting end by less than the resets scatter it.
    contact_s : time constant of a contact.
    """

    friction: float
    bending_stiffness_n_m2: float
    bending_damping_s: float
    hysteresis_n_m: float
    tightest_bend_m: float
    endpoint_radius_m: float
    segments: int = 30
    step_s: float = 0.001
    contact_s: float = 0.003

    def with_friction(self, factor: float) -> "CableTruth":
        """Return the cable on a board whose friction is `factor` times as strong."""
        return replace(self, friction=self.friction * factor)


def build_cable(cable: Cable, truth: CableTruth) -> mujoco.MjSpec:
    """Return the held end, the chain and the board as an editable MuJoCo specification.

    The held end has five joints (`TOOL_JOINTS`) that `drive` moves; every segment hinges about
    z and about y against the one before. A third hinge is left out: the gripper keeps the cable
    from rolling about its own axis, which would let it cross the board without friction.
    """
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    _set_solver(spec, truth)
    spec.worldbody.add_geom(
        name="board",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[0, 0, 1],
        contype=BOARD_BIT,
        conaffinity=CABLE_BIT,
        **_surface(truth),
    )
    body = _add_tool(spec, cable)
    length = cable.length_m / truth.segments
    for index in range(truth.segments):
        body = body.add_body(name=f"segment_{index}", pos=[length if index else 0, 0, 0])
        _add_joints(body, truth, length, first=index == 0)
        _add_segment(body, cable, truth, length)
    _add_endpoint(body, cable, truth, length)
    return spec


def compile_cable(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """Compile, keeping the solver's tolerance free of the tool's huge armature.

    MuJoCo scales its stopping rule by the mean inertia; with the tool's in it the solver would
    stop early and the end would miss by centimetres.
    """
    model = spec.compile()
    model.stat.meaninertia = 1e-3
    return model


def bend_angles(headings_rad: np.ndarray) -> np.ndarray:
    """Return hinge angles (segments,) about z of a flat cable from segment headings."""
    return np.diff(headings_rad, prepend=0.0)


def nodes(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """Return the chain's nodes (segments + 1, 3) [m] from the held end to the free end."""
    mujoco.mj_kinematics(model, data)  # a step leaves positions as they were before it
    first, last = model.body("segment_0").id, model.body("endpoint").id
    return data.xpos[first : last + 1].copy()


def _set_solver(spec: mujoco.MjSpec, truth: CableTruth) -> None:
    # The pyramidal cone moves the resting end by 5–30 cm, the elliptic one is isotropic.
    option = spec.option
    option.timestep = truth.step_s
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.solver = mujoco.mjtSolver.mjSOL_CG
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = 5


def _surface(truth: CableTruth) -> dict:
    return {
        "friction": [truth.friction, 0, 0],
        "condim": 3,
        "solref": [truth.contact_s, 1],
    }


def _add_tool(spec: mujoco.MjSpec, cable: Cable) -> mujoco.MjsBody:
    tool = spec.worldbody.add_body(
        name="tool",
        pos=[0, 0, cable.radius_m],
        explicitinertial=True,
        mass=1e-3,
        ipos=[0, 0, 0],
        inertia=[1e-6] * 3,
    )
    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    kinds = (slide, slide, slide, hinge, hinge)
    axes = ([1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 1], [0, 1, 0])
    for name, kind, axis in zip(TOOL_JOINTS, kinds, axes, strict=True):
        tool.add_joint(name=name, type=kind, axis=axis, armature=TOOL_ARMATURE)
    return tool


def _add_joints(body: mujoco.MjsBody, truth: CableTruth, length: float, *, first: bool) -> None:
    # Half a segment bends between the gripper and the first segment's middle.
    stiffness = truth.bending_stiffness_n_m2 / length * (2 if first else 1)
    widest = length / truth.tightest_bend_m
    # Lifted past a right angle a segment would point along the hinge about z and spin freely.
    limits = (widest, min(widest, STEEPEST_RAD))
    for axis, limit in zip(([0, 0, 1], [0, 1, 0]), limits, strict=True):
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


def _add_segment(body: mujoco.MjsBody, cable: Cable, truth: CableTruth, length: float) -> None:
    mass, radius = cable.mass_kg / truth.segments, cable.radius_m
    across = mass * (radius**2 / 4 + length**2 / 12)
    body.explicitinertial = True
    body.mass = mass
    body.ipos = [length / 2, 0, 0]
    body.inertia = [mass * radius**2 / 2, across, across]
    _add_ball(body, radius, length / 2, truth)


def _add_endpoint(body: mujoco.MjsBody, cable: Cable, truth: CableTruth, length: float) -> None:
    radius = truth.endpoint_radius_m
    end = body.add_body(
        name="endpoint",
        pos=[length, 0, 0],
        explicitinertial=True,
        mass=cable.endpoint_mass_kg,
        ipos=[0, 0, 0],
        inertia=[0.5 * cable.endpoint_mass_kg * radius**2] * 3,
    )
    # A flat underside, level with the cable's. On a ball as thick as the weight is wide the end
    # would be held up and roll sideways, which drags it by 1–2 % of the cable's length a cast.
    _add_ball(end, cable.radius_m, 0.0, truth)


def _add_ball(body: mujoco.MjsBody, radius: float, along: float, truth: CableTruth) -> None:
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[radius, 0, 0],
        pos=[along, 0, 0],
        mass=0,
        contype=CABLE_BIT,
        conaffinity=BOARD_BIT,
        **_surface(truth),
    )
