"""What a vector costs: the average waypoint error, and a penalty where a run diverges."""

import numpy as np
import pytest

from robotcast.fitting.parameter import Parameter
from robotcast.tuning.objective import full_vectors


def test_frozen_parameters_keep_their_value() -> None:
    parameters = (
        Parameter("a", "1", 0.0, 2.0, 1.5, frozen=True),
        Parameter("b", "1", 0.01, 1.0, 0.1, scale="log"),
    )
    np.testing.assert_allclose(full_vectors(parameters, np.array([[0.5]])), [[1.5, 0.1]])


def test_a_parameter_outside_its_bounds_is_refused() -> None:
    with pytest.raises(ValueError, match="lower ≤ nominal ≤ upper"):
        Parameter("mu", "1", 0.1, 0.5, 0.6)
