"""How a batch of chains is stepped."""

import mujoco
import numpy as np

from robotcast.effects.active import ActiveEffects
from robotcast.measurements.measurement_set import Cable
from robotcast.simulators.chain.model import chain_model
from robotcast.simulators.chain.run import implicitly_damped
from robotcast.simulators.chain.segmented import SegmentedSettings, SegmentedSimulator
from robotcast.simulators.chain.undistracted import undistracted
from robotcast.simulators.geometry import TOOL_DOFS, ChainGeometry

CABLE = Cable("cable1", 0.63, 0.008, 0.0045, 0.02)
STEP_S = 0.004
# friction, cable, endpoint, joint friction, EI, its damping, grip, EA
VECTOR = np.array([[0.3, 0.02, 0.01, 1e-4, 1e-3, 0.1, 1.0, 300.0]])


def test_a_step_has_the_bits_of_mujocos_own_implicit_damping() -> None:
    geometry = ChainGeometry.of_cable(CABLE.length_m, 18, 3)
    pose = np.array([[0.6, 0.0, 0.3]])
    run = SegmentedSimulator.run(
        CABLE,
        geometry,
        implicitly_damped(geometry, STEP_S),
        SegmentedSettings(),
        pose,
        np.array([0.2]),
        VECTOR,
        ActiveEffects((), np.empty((1, 0))),
    )
    model = chain_model(geometry, STEP_S)
    for name in ("body_mass", "body_ipos", "body_inertia", "jnt_stiffness"):
        getattr(model, name)[:] = run._batch.expand(name)[0]
    data = mujoco.MjData(model)
    for step in range(60):
        data.qpos[:], data.qvel[:] = run._qpos[0], run._qvel[0]
        turned = pose + np.array([0.0, 0.0, 0.02 * step])
        run.step(run.state(), turned)
        model.dof_damping[:] = run._batch.expand("dof_damping")[0]
        data.qfrc_applied[:] = run._applied[0]
        mujoco.mj_step(model, data)
        np.testing.assert_array_equal(run._qpos[0], data.qpos)
        np.testing.assert_array_equal(run._qvel[0], data.qvel)
    assert np.abs(run._qvel[0, TOOL_DOFS:]).max() > 0.1


def test_a_timer_that_somebody_set_is_kept() -> None:
    def own() -> float:
        return 1.0

    mujoco.set_mjcb_time(own)
    try:
        undistracted()
        assert mujoco.get_mjcb_time() is own
    finally:
        mujoco.set_mjcb_time(None)
