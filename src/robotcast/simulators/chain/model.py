"""The MuJoCo model of a chain."""

import mujoco

from robotcast.simulators.geometry import ChainGeometry

TOOL_ARMATURE = 1e4  # kg and kg m²: so large that the cable cannot move the held end


def chain_model(geometry: ChainGeometry, step_s: float) -> mujoco.MjModel:
    """Compile the chain: slides x and y and a hinge for the tool, then one hinge a segment.

    Where a segment stretches, a slide along it follows its hinge.

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
        if geometry.stretching[k]:
            body.add_joint(name=f"slide{k}", type=slide, axis=[1, 0, 0])
    return spec.compile()
