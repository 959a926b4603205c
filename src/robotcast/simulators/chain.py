"""A planar chain of rigid segments: its geometry, and its MuJoCo model.

The chain lies in the board's plane. Its generalised coordinates are the held end's x, y and
yaw, then one hinge angle per segment, each with the segment's stretch behind it where the chain
stretches.
"""

from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

TOOL_DOFS = 3
TOOL_ARMATURE = 1e4  # kg and kg m²: so large that the cable cannot move the held end


@dataclass(frozen=True)
class ChainGeometry:
    """How a cable is cut into segments and hinges.

    A hinge stands for the bending of the cable around it, and sits in the middle of what it
    stands for. Between segments that is one segment length l. At the gripper it is the first
    l/2, so the first hinge sits at l/4, at the end of a stub that is part of the gripper.

    Attributes
    ----------
    stub_m : distance from the held end to the first hinge.
    lengths_m : ndarray of shape (n,), from each hinge to the next, the last to the free end.
    bends_m : ndarray of shape (n,), the length of cable whose bending each hinge carries.
    """

    stub_m: float
    lengths_m: np.ndarray
    bends_m: np.ndarray

    @classmethod
    def of_cable(cls, length_m: float, segments: int) -> "ChainGeometry":
        """Cut a cable into `segments` of equal length but for the first (see above)."""
        full = length_m / segments
        lengths, bends = np.full(segments, full), np.full(segments, full)
        lengths[0] -= 0.25 * full
        bends[0] = 0.5 * full
        return cls(0.25 * full, lengths, bends)

    @cached_property
    def stretches_m(self) -> np.ndarray:
        """The length of cable whose stretching each slide carries, (n,).

        That is from the centre of the segment before, or the held end, to the centre of its
        own; the last carries what lies beyond its centre too. They add up to the cable.
        """
        half = 0.5 * self.lengths_m
        reach = half + np.concatenate([[self.stub_m], half[:-1]])
        reach[-1] += half[-1]
        return reach

    @cached_property
    def half_m(self) -> np.ndarray:
        """Half the segments' lengths, float32 (n,)."""
        return (0.5 * self.lengths_m).astype(np.float32)


def capsule_inertia(mass_kg: np.ndarray, length_m: np.ndarray, radius_m: float) -> np.ndarray:
    """Return the inertia [kg m²] of a solid rod about its centre, across its axis."""
    return mass_kg * (length_m**2 / 12 + radius_m**2 / 4)


def chain_model(geometry: ChainGeometry, step_s: float, stretches: bool = False) -> mujoco.MjModel:
    """Compile the chain: slides x and y and a hinge for the tool, then one hinge a segment.

    Where the chain `stretches`, a slide along the segment follows every hinge.

    No contacts, gravity or constraints: friction and every effect enter as applied forces,
    masses and joint properties are written per simulation.
    """
    spec = mujoco.MjSpec()
    spec.option.timestep = step_s
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    for flag in ("CONSTRAINT", "CONTACT", "GRAVITY", "SENSOR", "AUTORESET"):
        spec.option.disableflags |= int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag}"))
    body = spec.worldbody.add_body(name="tool", mass=1e-3, inertia=[1e-6, 1e-6, 1e-6])
    body.explicitinertial = True
    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    for name, kind, axis in (
        ("x", slide, [1, 0, 0]),
        ("y", slide, [0, 1, 0]),
        ("yaw", hinge, [0, 0, 1]),
    ):
        body.add_joint(name=name, type=kind, axis=axis, armature=TOOL_ARMATURE)
    for k, hinge_m in enumerate((geometry.stub_m, *geometry.lengths_m[:-1])):
        body = body.add_body(
            name=f"segment{k}",
            pos=[hinge_m, 0, 0],
            mass=1e-3,
            inertia=[1e-7, 1e-7, 1e-7],
        )
        body.explicitinertial = True
        body.add_joint(name=f"hinge{k}", type=hinge, axis=[0, 0, 1])
        if stretches:
            body.add_joint(name=f"slide{k}", type=slide, axis=[1, 0, 0])
    return spec.compile()
