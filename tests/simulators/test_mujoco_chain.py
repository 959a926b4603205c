"""How a cable is cut into segments, hinges and slides, and how a batch of chains is stepped."""

import mujoco
import numpy as np
import pytest

from robotcast.effects.effect import ActiveEffects
from robotcast.simulators.chain import TOOL_DOFS, ChainGeometry
from robotcast.simulators.mujoco_cables import (
    ChainSettings,
    SegmentedRun,
    chain_model,
    quiet_mujoco,
)
from tests.simulators.conftest import CABLE

STEP_S = 0.004
# friction, cable, endpoint, joint friction, EI, its damping, grip, EA
VECTOR = np.array([[0.3, 0.02, 0.01, 1e-4, 1e-3, 0.1, 1.0, 300.0]])


@pytest.mark.parametrize("stretches", [1, 3, 5, 18])
def test_hinges_and_slides_carry_the_whole_cable(stretches: int) -> None:
    geometry = ChainGeometry.of_cable(0.63, 18, stretches)
    assert geometry.stub_m + geometry.lengths_m.sum() == pytest.approx(0.63)
    # the first l/2 bends in the first hinge, the last l/2 is straight
    assert geometry.bends_m.sum() == pytest.approx(0.63 * (1 - 0.5 / 18))
    assert len(geometry.stretches_m) == geometry.stretching.sum() == stretches
    assert geometry.stretches_m.sum() == pytest.approx(0.63)
    if stretches == 3:
        np.testing.assert_allclose(geometry.stretches_m, 0.21)


@pytest.mark.parametrize("stretches", [0, 3, 18])
def test_the_coordinates_are_those_of_the_model(stretches: int) -> None:
    geometry = ChainGeometry.of_cable(0.63, 18, stretches)
    model = chain_model(geometry, 0.004)
    assert model.nq == TOOL_DOFS + 18 + stretches
    names = [model.joint(k).name for k in range(model.njnt)]
    assert [names[k] for k in geometry.hinges] == [f"hinge{k}" for k in range(18)]
    assert [names[k] for k in geometry.slides if k >= 0] == [
        f"slide{k}" for k in np.flatnonzero(geometry.stretching)
    ]
    assert geometry.hinges[0] == TOOL_DOFS


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"stretches": 19}, "of 18 segments, 0 to 18 stretch, got 19"),
        ({"stretch_damping_s": 0.001}, "damping_s must be at least half of step_s"),
    ],
)
def test_settings_that_cannot_be_are_refused(settings: dict, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        ChainSettings(**settings)


def test_a_step_has_the_bits_of_mujocos_own_implicit_damping() -> None:
    geometry = ChainGeometry.of_cable(CABLE.length_m, 18, 3)
    pose = np.array([[0.6, 0.0, 0.3]])
    settings, nothing = ChainSettings(), ActiveEffects((), np.empty((1, 0)))
    run = SegmentedRun(CABLE, settings, STEP_S, pose, np.array([0.2]), VECTOR, nothing)
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
        quiet_mujoco()
        assert mujoco.get_mjcb_time() is own
    finally:
        mujoco.set_mjcb_time(None)
