"""D_sim's casts begin as the measured ones did."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from robotcast.casts.plan import PlanLimits, plan_actions, plan_cast
from robotcast.simulators.generation import generate_casts, mean_reach
from robotcast.simulators.simulator import Cast, Prediction, SimulatedCast

CAST = plan_cast(0.4, -0.4, 0.7, 0.5, 1.5, r0_m=0.6, limits=PlanLimits())
PLAN = partial(plan_actions, r0_m=0.6, limits=PlanLimits())


class Still:
    """A cable that stays where it starts."""

    name, parameters = "still", ()

    def simulate(self, casts: Sequence[Cast], vectors: np.ndarray, **_: object) -> Prediction:
        starts = [np.full(2, np.nan) if c.start_m is None else c.start_m for c in casts]
        return Prediction(np.array(starts)[None, :, None], np.zeros((1, len(casts)), dtype=bool))


def seen_at(*start_m: float) -> SimulatedCast:
    return SimulatedCast(CAST.tool, np.zeros(1), np.array(start_m))


def test_the_free_end_starts_where_resets_left_it_on_average() -> None:
    reach_m = mean_reach([seen_at(1.22, 0.01), seen_at(1.24, -0.004)])
    assert reach_m is not None
    np.testing.assert_allclose(reach_m, [0.63, 0.003])
    actions = CAST.action.as_array()[None]
    told = generate_casts(Still(), np.zeros(0), actions, PLAN, settle_s=1.0, reach_m=reach_m)
    np.testing.assert_allclose(told.endpoints_m, [[1.23, 0.003]])


def test_casts_that_show_no_start_leave_it_to_the_tool() -> None:
    assert mean_reach([SimulatedCast(CAST.tool, np.ones(1))]) is None
    actions = CAST.action.as_array()[None]
    told = generate_casts(Still(), np.zeros(0), actions, PLAN, settle_s=1.0)
    assert np.isnan(told.endpoints_m).all()
