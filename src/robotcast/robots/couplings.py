"""What is put into a model before it is compiled: meshes, servos, and tendons between joints.

Friction between two joints, as of a cable or a differential that both move, MuJoCo solves as dry
friction of a fixed tendon. So every model gets two tendons for each pair of neighbouring joints,
q₁ + q₂ and q₁ − q₂, without any friction: they change nothing until an effect gives them some.
"""

from collections.abc import Mapping
from fnmatch import fnmatchcase
from itertools import pairwise
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from robotcast.robots.effect import RobotEffect
from robotcast.robots.model_fields import ModelFields
from robotcast.robots.names import Address

WORLD = "world"
PACKAGE = "package://"  # of a mesh that a URDF names by its ROS package
MOST_JOINTS = 4  # of a robot whose pairs of joints are looked at
MOTOR = (
    mujoco.mjtTrn.mjTRN_JOINT,
    mujoco.mjtGain.mjGAIN_FIXED,
    mujoco.mjtBias.mjBIAS_NONE,
    mujoco.mjtDyn.mjDYN_NONE,
)
SINGLE = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)


def couple(spec: mujoco.MjSpec) -> mujoco.MjSpec:
    """Insert the tendons into a spec; return it."""
    for one, other in _neighbours(spec):
        for sign in (1.0, -1.0):
            tendon = spec.add_tendon(name=_name(one, other, sign))
            tendon.wrap_joint(one, 1.0)
            tendon.wrap_joint(other, sign)
    return spec


def serve(spec: Any, servos: Mapping[str, tuple[float, float]], where: str) -> None:
    """Make position servos of motors, by name or pattern → kp, kd of the joint in SI units.

    The last pattern that fits counts. What a motor's control is limited to limits the servo's
    torque. With a gear g its force f drives the joint by g f, and its length is g q.
    """
    names = [f"actuator[{one.name or k}]" for k, one in enumerate(spec.actuators)]
    wanted = {}
    for pattern, gains in servos.items():
        found = [n for n in names if fnmatchcase(n, pattern.replace("[", "[[]", 1))]
        if not found:
            raise ValueError(f"{where}: {pattern} is none of {', '.join(names) or 'no actuators'}")
        wanted |= dict.fromkeys(found, gains)
    for name, (kp, kd) in wanted.items():
        one = spec.actuators[names.index(name)]
        kinds = (one.trntype, one.gaintype, one.biastype, one.dyntype)
        if kinds != MOTOR:
            raise ValueError(
                f"{where}: {name} is no motor of a joint, which a servo can be made of"
            )
        gear, ends = one.gear[0], np.sort(np.array(one.ctrlrange) * one.gainprm[0])
        if one.ctrllimited != mujoco.mjtLimited.mjLIMITED_FALSE and ends.any():
            if one.forcelimited != mujoco.mjtLimited.mjLIMITED_FALSE and np.any(one.forcerange):
                ends = np.clip(ends, *one.forcerange)
            one.forcerange, one.forcelimited = ends, mujoco.mjtLimited.mjLIMITED_TRUE
        one.ctrllimited = mujoco.mjtLimited.mjLIMITED_FALSE
        one.set_to_position(kp=kp / gear**2, kv=kd / gear**2)
        one.gainprm[0] = kp / gear


def coupled(model: mujoco.MjModel) -> list[tuple[str, str]]:
    """Return the names of the joints that a model has tendons between, the inner one first."""
    names = [model.joint(j).name for j in range(model.njnt)]
    found = (model.tendon(t).name.partition("+")[::2] for t in range(model.ntendon))
    return [(one, other) for one, other in found if one in names and other in names]


def moved_by(body: Any) -> Any:
    """Return the body that a joint moves and this one is fixed to, or the world."""
    while body.name != WORLD and not body.joints:
        body = body.parent
    return body


def _neighbours(spec: mujoco.MjSpec) -> list[tuple[str, str]]:
    """Return neighbouring joints of one kind."""
    found = []
    for body in spec.bodies[1:] if len(spec.joints) <= MOST_JOINTS else ():
        above = moved_by(body.parent)
        found += [
            (one.name, other.name)
            for one, other in pairwise([*list(above.joints)[-1:], *body.joints])
            if one.name and other.name and one.type == other.type and one.type in SINGLE
        ]
    return found


class CoupledFriction(RobotEffect):
    """Dry friction of the sum or of the difference of two joints' speeds, by its `sign`."""

    def __init__(self, *args: Any, sign: float, **more: Any) -> None:
        super().__init__(*args, **more)
        self.sign = sign

    def write(self, fields: ModelFields, *, friction: np.ndarray) -> None:
        model = fields.model
        one, other = (model.joint(int(model.dof_jntid[dof])).name for dof in self.where.dofs)
        row = model.tendon(_name(one, other, self.sign)).id
        fields.add(Address("tendon.frictionloss", "tendon_frictionloss", (row,), None), friction)

    def patch(self, spec: mujoco.MjSpec, model: mujoco.MjModel, **values: float) -> bool:
        if not any(tendon.name == model.tendon(model.ntendon - 1).name for tendon in spec.tendons):
            couple(spec)  # the file's own tendons come before
        return True


def _name(one: str, other: str, sign: float) -> str:
    return f"{one}{'+' if sign > 0 else '-'}{other}"


def find_meshes(spec: Any, path: Path) -> None:
    """Write where meshes of packages lie into a spec: in a folder above the file, or below one.

    One that is not there is a ValueError.
    """
    for mesh in spec.meshes:
        if not mesh.file.startswith(PACKAGE):
            continue
        package, _, inside = mesh.file.removeprefix(PACKAGE).partition("/")
        above = path.resolve().parents
        places = [place for folder in above for place in (folder / package, folder)]
        found = [place / inside for place in places if (place / inside).is_file()]
        if not found:
            raise ValueError(
                f"{path}: there is no mesh {mesh.file}; copy the folder {package}/ of that package "
                "beside the file"
            )
        mesh.file = str(found[0])
