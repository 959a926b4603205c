"""How a cable is cut into segments, hinges and slides."""

import numpy as np
import pytest

from robotcast.simulators.chain.model import chain_model
from robotcast.simulators.geometry import TOOL_DOFS, ChainGeometry


@pytest.mark.parametrize("stretches", [1, 3, 5, 18])
def test_hinges_and_slides_carry_the_whole_cable(stretches: int) -> None:
    geometry = ChainGeometry.of_cable(0.63, 18, stretches)
    assert geometry.stub_m + geometry.lengths_m.sum() == pytest.approx(0.63)
    # the first l/2 bends in the first hinge, the last l/2 is straight
    assert geometry.bends_m.sum() == pytest.approx(0.63 * (1 - 0.5 / 18))
    assert len(geometry.stretches_m) == geometry.stretching.sum() == stretches
    assert geometry.stretches_m.sum() == pytest.approx(0.63)


def test_three_slides_carry_a_third_each() -> None:
    geometry = ChainGeometry.of_cable(0.63, 18, 3)
    np.testing.assert_allclose(geometry.stretches_m, 0.21)


@pytest.mark.parametrize("stretches", [0, 3, 18])
def test_the_coordinates_are_those_of_the_model(stretches: int) -> None:
    geometry = ChainGeometry.of_cable(0.63, 18, stretches)
    model = chain_model(geometry, 0.004)
    assert model.nq == geometry.dofs
    names = [model.joint(k).name for k in range(model.njnt)]
    assert [names[k] for k in geometry.hinges] == [f"hinge{k}" for k in range(18)]
    assert [names[k] for k in geometry.slides if k >= 0] == [
        f"slide{k}" for k in np.flatnonzero(geometry.stretching)
    ]
    assert geometry.hinges[0] == TOOL_DOFS


def test_more_segments_that_stretch_than_there_are_is_refused() -> None:
    with pytest.raises(ValueError, match="of 18 segments, 0 to 18 stretch, got 19"):
        ChainGeometry.of_cable(0.63, 18, 19)
