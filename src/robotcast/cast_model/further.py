"""Casts that could be run next, as diagnosis sees them."""

import numpy as np

from robotcast.cast_model.model import CastModel
from robotcast.casts.action import Action, action_factors
from robotcast.casts.plan import PlanLimits, plan_actions
from robotcast.diagnosis.model import Record
from robotcast.diagnosis.next_trials import Further
from robotcast.measurements.measurement_set import MeasurementSet
from robotcast.simulators.simulator import SimulatedCast


def further_casts(
    model: CastModel,
    measured: MeasurementSet,
    feasible: np.ndarray,
    limits: PlanLimits,
    most: int,
    seed: int,
) -> Further:
    """Return casts of actions drawn from the feasible ones (m, 6), half of them mirrored.

    The arm is taken to do what it is told, and the cable to start straight. A cast is watched
    for as long after its end as the measured ones were at most.
    """
    if not len(feasible):
        return Further(model, ())
    random = np.random.default_rng(seed)
    rows = feasible[random.permutation(len(feasible))[:most]]
    mirrored = random.permutation(len(rows)) < len(rows) // 2
    actions = [Action.from_array(row) for row in rows]
    actions = [a.mirrored() if m else a for a, m in zip(actions, mirrored, strict=True)]
    told = np.array([action.as_array() for action in actions])
    coast_s = max(float(t.waypoints_s[-1] - t.tool.t_s[-1]) for t in measured.trials)
    casts, records = {}, []
    for number, planned in enumerate(plan_actions(told, r0_m=measured.r0_m, limits=limits)):
        times_s = np.arange(0.0, planned.end_s + max(coast_s, 0.0), measured.period_s)
        nowhere = np.full((len(times_s), 2), np.nan)
        factors = action_factors(planned.action.as_array() + 0.0)  # no −0
        casts[number] = SimulatedCast(planned.tool, times_s, factors=factors)
        records.append(Record(number, number, times_s, nowhere, factors))
    return Further(model.of_casts(casts), tuple(records))
