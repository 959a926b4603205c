"""What is put into a model before it is compiled: tendons between joints, and servos of motors.

Friction between two joints, as of a cable or a differential that both move, MuJoCo solves as dry
friction of a fixed tendon. So every model gets two tendons for each pair of neighbouring joints,
q₁ + q₂ and q₁ − q₂, without any friction: they change nothing until an effect gives them some.
"""

from collections.abc import Mapping
from fnmatch import fnmatchcase
from itertools import pairwise
from typing import Any

import mujoco
import numpy as np

from robotcast.robots.effect import RobotEffect
from robotcast.robots.model_fields import ModelFields
from robotcast.robots.names import Address

MOST_JOINTS = 4  # of a robot whose pairs of joints are looked at
SINGLE = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)


def couple(spec: mujoco.MjSpec) -> mujoco.MjSpec:
    """Insert the tendons into a spec; return it."""
    for one, other in _neighbours(spec):
        for sign in (1.0, -1.0):
            tendon = spec.add_tendon(name=_name(one, other, sign))
            tendon.wrap_joint(one, 1.0)
            tendon.wrap_joint(other, sign)
    return spec


def serve(spec: Any, servos: Mapping[str, tuple[float, float]], where: str) -> Any:
    """Make position servos of motors, by name or pattern → kp, kd in N m/rad or N/m; return it.

    The torques that a motor's control is limited to limit the servo's.
    """
    names = [f"actuator[{one.name or k}]" for k, one in enumerate(spec.actuators)]
    for pattern, (kp, kd) in servos.items():
        found = [n for n in names if fnmatchcase(n, pattern.replace("[", "[[]", 1))]
        if not found:
            raise ValueError(f"{where}: {pattern} is none of {', '.join(names) or 'no actuators'}")
        for one in (spec.actuators[names.index(name)] for name in found):
            ends = np.sort(np.array(one.ctrlrange) * one.gainprm[0] * one.gear[0])
            one.set_to_position(kp=kp, kv=kd)
            one.gear[0], one.ctrllimited = 1.0, mujoco.mjtLimited.mjLIMITED_FALSE
            if ends.any():
                one.forcerange, one.forcelimited = ends, mujoco.mjtLimited.mjLIMITED_TRUE
    return spec


def coupled(model: mujoco.MjModel) -> list[tuple[str, str]]:
    """Return the names of the joints that a model has tendons between, the inner one first."""
    names = [model.joint(j).name for j in range(model.njnt)]
    found = (model.tendon(t).name.partition("+")[::2] for t in range(model.ntendon))
    return [(one, other) for one, other in found if one in names and other in names]


def _neighbours(spec: mujoco.MjSpec) -> list[tuple[str, str]]:
    """Return neighbouring joints of one kind."""
    found = []
    for body in spec.bodies[1:] if len(spec.joints) <= MOST_JOINTS else ():
        above = body.parent
        while above.name != "world" and not above.joints:
            above = above.parent
        found += [
            (one.name, other.name)
            for one, other in pairwise([*list(above.joints)[-1:], *body.joints])
            if one.name and other.name and one.type == other.type and one.type in SINGLE
        ]
    return found


class CoupledFriction(RobotEffect):
    """Dry friction of the sum or of the difference of two joints' speeds, by its `sign`."""

    part = "pair"

    def __init__(self, *args: Any, sign: float, **more: Any) -> None:
        super().__init__(*args, **more)
        self.sign = sign

    def write(self, fields: ModelFields, *, friction: np.ndarray) -> None:
        model = fields.model
        one, other = (model.joint(int(model.dof_jntid[dof])).name for dof in self.where.dofs)
        row = model.tendon(_name(one, other, self.sign)).id
        fields.add(Address("tendon.frictionloss", "tendon_frictionloss", (row,), None), friction)

    def patch(self, spec: mujoco.MjSpec, model: mujoco.MjModel, **values: float) -> bool:
        if not any(tendon.name == model.tendon(0).name for tendon in spec.tendons):
            couple(spec)
        return True


def _name(one: str, other: str, sign: float) -> str:
    return f"{one}{'+' if sign > 0 else '-'}{other}"
