"""What a vector costs: the average waypoint error, and a penalty where a run diverges."""

import numpy as np
import pytest

from robotcast.casts.action import Action, ToolMotion
from robotcast.fitting.parameter import Parameter
from robotcast.measurements.measurement_set import Trial
from robotcast.running import silent
from robotcast.simulators.simulator import Prediction, Simulator
from robotcast.tuning.objective import WaypointError, full_vectors
from robotcast.tuning.search import Query

LENGTH_M = 0.5
T_S = np.arange(0, 1, 0.1)
TOOL = ToolMotion(np.array([0.0, 1.0]), np.array([[0.6, 0.0, 0.0], [0.6, 0.5, 0.0]]))
ACTION = Action(0.5, 0.6, -0.5, 0.7, 0.5, 2.0)
TRIALS = tuple(Trial(n, n, ACTION, TOOL, T_S[: 10 - n], np.zeros((10 - n, 2))) for n in range(3))


class Drift(Simulator):
    """Ends lie `offset` metres off in x, later ones too; `says` is what a diverged run says."""

    name = "drift"
    parameters = (Parameter("offset", "m", 0.0, 1.0, 0.5),)

    def __init__(self, says: float = np.nan) -> None:
        self.says = says

    def simulate(self, casts, vectors, *, retry=True, progress=silent) -> Prediction:
        waypoints_m = np.full((len(vectors), len(casts), 10, 2), np.nan)
        for i, cast in enumerate(casts):
            k = len(cast.waypoints_s)
            waypoints_m[:, i, :k, 0], waypoints_m[:, i, :k, 1] = vectors, 0.0
        diverged = np.tile(vectors > 0.8, (1, len(casts)))
        waypoints_m[diverged] = self.says
        return Prediction(waypoints_m, diverged)


def asked(*offsets_m: float, says: float = np.nan, **more):
    objective = WaypointError(Drift(says), TRIALS, LENGTH_M)
    return objective(Query(np.array(offsets_m)[:, None], **more))


def test_a_vector_costs_the_average_waypoint_error_in_percent_of_cable_length() -> None:
    np.testing.assert_allclose(asked(0.05, 0.1).percent, [10, 20])


@pytest.mark.parametrize("says", [np.nan, np.inf, -np.inf])
def test_a_diverged_run_costs_one_cable_length_and_is_counted(says: float) -> None:
    response = asked(0.05, 0.9, says=says, with_residuals=True)
    np.testing.assert_allclose(response.percent, [10, 100])
    np.testing.assert_array_equal(response.diverged, [0, 3])
    assert response.residuals is not None and np.isfinite(response.residuals).all()


def test_the_misses_of_a_cast_sum_to_its_mean_square_miss_and_none_gains_by_diverging() -> None:
    response = asked(0.05, with_residuals=True)
    assert response.residuals is not None
    np.testing.assert_allclose((response.residuals**2).sum(axis=-1), np.full((1, 3), 100.0))
    wild, lost = asked(0.75, 0.9).percent
    assert wild <= lost


def test_a_query_about_some_casts_and_their_beginnings_sees_no_more() -> None:
    response = asked(0.05, casts=(0, 2), share=0.5, with_residuals=True)
    assert response.residuals is not None
    assert response.residuals.shape == (1, 2, 2 * 5)
    assert (response.residuals[0, 0, ::2] != 0).sum() == 5
    assert (response.residuals[0, 1, ::2] != 0).sum() == 4


def test_frozen_parameters_keep_their_value() -> None:
    parameters = (
        Parameter("a", "1", 0.0, 2.0, 1.5, frozen=True),
        Parameter("b", "1", 0.01, 1.0, 0.1, scale="log"),
    )
    np.testing.assert_allclose(full_vectors(parameters, np.array([[0.5]])), [[1.5, 0.1]])


def test_a_parameter_outside_its_bounds_is_refused() -> None:
    with pytest.raises(ValueError, match="lower ≤ nominal ≤ upper"):
        Parameter("mu", "1", 0.1, 0.5, 0.6)
