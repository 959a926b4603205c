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

from robotcast.robots.effect import Where
from robotcast.robots.names import SIGNS, inserted, moved, names_of

WORLD = "world"
PACKAGE = "package://"  # of a mesh that a URDF names by its ROS package
MOST_JOINTS = 4  # of a robot whose pairs of joints are looked at
MOTOR = (
    mujoco.mjtTrn.mjTRN_JOINT,
    mujoco.mjtGain.mjGAIN_FIXED,
    mujoco.mjtBias.mjBIAS_NONE,
    mujoco.mjtDyn.mjDYN_NONE,
)
AWAY = 0.3  # rad or m, by which joints are turned to see what tendons pull at
ALIKE = 0.999  # cosine, from which two tendons pull alike
SINGLE = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)


def couple(spec: mujoco.MjSpec) -> mujoco.MjSpec:
    """Insert the tendons into a spec; return it."""
    for one, other in _neighbours(spec):
        for mark in SIGNS:
            insert(spec, one, mark, other)
    return spec


def insert(spec: Any, one: str, mark: str, other: str) -> None:
    """Insert one of the tendons into a spec."""
    tendon = spec.add_tendon(name=f"{one}{mark}{other}")
    tendon.wrap_joint(one, 1.0)
    tendon.wrap_joint(other, SIGNS[mark])


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


def tendon_arms(model: mujoco.MjModel) -> np.ndarray:
    """Return by how much tendons grow with every joint, (ntendon, nv).

    That is where they grow most of a few poses, since on a stretched chain a tendon may pull at
    nothing. What is less than a thousandth of a tendon's largest counts as 0.
    """
    poses = _arms_by_pose(model)
    at = np.abs(poses).argmax(axis=0)
    arms = np.take_along_axis(poses, at[None], axis=0)[0]
    size = np.abs(arms)
    return np.where(size > 1e-3 * size.max(axis=1, keepdims=True, initial=0.0), arms, 0.0)


def _arms_by_pose(model: mujoco.MjModel) -> np.ndarray:
    """Return the same in poses about the file's, or the nearest in the joints' ranges, (3, …)."""
    data, poses, angles = mujoco.MjData(model), [], np.arange(model.nv)
    home, single = model.qpos0.copy(), model.jnt_limited & np.isin(model.jnt_type, SINGLE)
    for joint in np.flatnonzero(single):
        at = model.jnt_qposadr[joint]
        home[at] = np.clip(home[at], *model.jnt_range[joint])
    for by in np.array([0 * angles, AWAY * np.cos(angles), AWAY * np.sin(angles)]):
        data.qpos[:] = moved(model, home[None], by[None])[0]
        mujoco.mj_fwdPosition(model, data)
        poses.append(np.zeros((model.ntendon, model.nv)))
        if model.ntendon:
            of = model.ten_J_rownnz, model.ten_J_rowadr, model.ten_J_colind
            mujoco.mju_sparse2dense(poses[-1], data.ten_J, *of)
    return np.array(poses)


def tendon_parts(model: mujoco.MjModel, most: int | None = None) -> dict[str, list[Where]]:
    """Return tendons of sums and differences of joints, and the own ones: above `most` as one.

    What pulls at one joint alone is the joint's, but by an arm that changes with it, as a
    cylinder's does; a sum or a difference that the file has a tendon of is that tendon's.
    """
    found: dict[str, list[Where]] = {"sum": [], "difference": [], "tendon": []}
    pairs, arms, by_pose = inserted(model), tendon_arms(model), np.abs(_arms_by_pose(model))
    change = by_pose.min(axis=0) < ALIKE * by_pose.max(axis=0)
    ways = arms / np.linalg.norm(arms, axis=1, keepdims=True).clip(1e-12)
    own = [t for t in range(model.ntendon) if t not in pairs]
    names = names_of(model, "tendon")
    for tendon in range(model.ntendon):
        if tendon in pairs:
            one, mark, other = pairs[tendon]
            kind, name = ("sum" if SIGNS[mark] > 0 else "difference"), f"{one}_and_{other}"
            twice = bool((np.abs(ways[own] @ ways[tendon]) > ALIKE).any())
        else:
            kind, name, twice = "tendon", f"tendon_{names[tendon]}", False
        dofs = np.flatnonzero(arms[tendon]).tolist()
        whole = len(dofs) > 1 or (len(dofs) == 1 and bool(change[tendon, dofs[0]]))
        if whole and not twice and not {*"[]"} & {*name}:
            found[kind] += [Where(name, tuple(dofs), (), (), (), (tendon,))]
    if most is not None and len(some := found["tendon"]) > most:
        dofs = tuple(sorted({dof for one in some for dof in one.dofs}))
        every = tuple(t for one in some for t in one.tendons)
        found["tendon"] = [Where("every_tendon", dofs, (), (), (), every)]
    return found


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
