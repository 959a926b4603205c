"""A simulator of casts and a measurement set as diagnosis sees them."""

from collections.abc import Callable, Collection, Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from robotcast.casts.action import MIRROR, action_factors
from robotcast.casts.plan import PlanLimits, plan_actions
from robotcast.diagnosis.decision import Unexplained, strengths
from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.model import Axis, Record, Wording
from robotcast.diagnosis.next_trials import Further
from robotcast.effects.effect import Effect
from robotcast.effects.library import AlongMotionField, PlaceField
from robotcast.fitting.parameter import Parameter
from robotcast.measurements.measurement_set import MeasurementSet, Trial
from robotcast.simulators.simulator import Cast, SimulatedCast, Simulator

BOARD_X_M, BOARD_Y_M = (0.4, 1.3, 10), (-0.8, 0.8, 13)  # where a field is drawn
STOPPED_M_S = 0.02  # the tool is slower than this once it has stopped
TURNING_S = 0.1  # before and after the tool rests in θ1: the reversal
STILL_M = 0.005  # the end is at rest once it stays this close to where it ends

CAST_WORDING = Wording(
    trial="cast",
    trials="casts",
    sample="waypoint",
    samples="waypoints",
    mover="the free end",
    axes=(
        Axis("x", "m", "far from the robot", "near the robot"),
        Axis("y", "m", "on the left", "on the right"),
    ),
    factor_units=dict(theta1="rad", r1="m", theta2="rad", r2="m", alpha="rad", vmax="m/s"),
)


class CastModel:
    """Predicts the free end's waypoints of measured casts.

    `make_simulator` makes the simulator with some of the `effects` active, the candidates and
    fields; `held` names the simulator's parameters that stay at their nominal values.
    """

    error_unit = "% of cable length"

    def __init__(
        self,
        measured: MeasurementSet,
        make_simulator: Callable[[Sequence[Effect]], Simulator],
        effects: Sequence[Effect],
        held: Collection[str] = (),
    ) -> None:
        self.effects: Mapping[str, Effect] = {effect.name: effect for effect in effects}
        self.scale = measured.cable.length_m
        self._casts: Mapping[int, Cast] = {trial.trial: trial for trial in measured.trials}
        self._simulator = cache(lambda names: make_simulator([self.effects[n] for n in names]))
        self.parameters: tuple[Parameter, ...] = tuple(
            replace(p, frozen=p.frozen or p.name in held) for p in self._simulator(()).parameters
        )

    def predict(
        self, records: Sequence[Record], active: Sequence[str], vectors: np.ndarray
    ) -> np.ndarray:
        """Predict waypoints (see `robotcast.diagnosis.model.Model`).

        A run that diverges is tried again more finely where one vector is asked for; fits, which
        compare many, count it as lost.
        """
        casts = []
        for record in records:
            cast = self._casts[record.trial]
            casts.append(SimulatedCast(cast.tool, record.times_s, cast.start_m, cast.factors))
        simulator, one = self._simulator(tuple(active)), len(vectors) == 1
        return simulator.simulate(casts, vectors, retry=one).waypoints_m

    def of_casts(self, casts: Mapping[int, Cast]) -> "CastModel":
        """Return the same model, which predicts other casts, by their number."""
        other = copy(self)
        other._casts = casts
        return other


def cast_records(measured: MeasurementSet) -> tuple[Record, ...]:
    """Return a record of every cast that was tracked."""
    return tuple(
        Record(
            trial=trial.trial,
            group=trial.action_id,
            times_s=trial.waypoints_s,
            measured=trial.waypoints_m,
            factors={name: value for name, value in trial.factors.items() if name != "r1"},
            phases=_phases(trial),
            ended=trial.rested,
        )
        for trial in measured.trials
        if len(trial.waypoints_s)
    )


def _phases(trial: Trial) -> dict[str, float]:
    """Return when each phase of the motion starts [s].

    The tool turns back at the extreme of its angle about the base, before it comes to rest.
    """
    t_s, pose = trial.tool.t_s, trial.tool.pose
    speed = np.linalg.norm(np.gradient(pose[:, :2], t_s, axis=0), axis=1)
    stop_s = float(t_s[np.flatnonzero(speed > STOPPED_M_S).max(initial=0)])
    angle = np.unwrap(np.arctan2(pose[:, 1], pose[:, 0]))
    final = np.sign(angle[-1] - angle[0]) or 1.0
    moving_tool = t_s <= stop_s
    turn_s = float(t_s[moving_tool][np.argmin(final * angle[moving_tool])])
    from_end_m = np.linalg.norm(trial.waypoints_m - trial.endpoint_m, axis=1)
    moving = np.flatnonzero(from_end_m > STILL_M)
    rest_s = trial.waypoints_s[min(moving[-1] + 1, len(from_end_m) - 1)] if moving.size else stop_s
    return {
        "first arc": 0.0,
        "reversal": max(turn_s - TURNING_S, 0.0),
        "second arc": min(turn_s + TURNING_S, stop_s),
        "coast": stop_s,
        "rest": max(float(rest_s), stop_s),
    }


def candidate_casts(
    model: CastModel,
    measured: MeasurementSet,
    feasible: np.ndarray,
    limits: PlanLimits,
    most: int,
    seed: int,
) -> Further:
    """Return casts of actions drawn from the feasible ones (m, 6), half of them mirrored.

    The arm is taken to follow its plan, and the cable to start straight. A cast is watched
    for as long after its end as the measured ones were at most.
    """
    if not len(feasible):
        return Further(model, ())
    random = np.random.default_rng(seed)
    rows = feasible[random.permutation(len(feasible))[:most]]
    mirrored = random.permutation(len(rows)) < len(rows) // 2
    rows = np.where(mirrored[:, None], rows * MIRROR, rows)
    coast_s = max(float(t.waypoints_s[-1] - t.tool.t_s[-1]) for t in measured.trials)
    casts, records = {}, []
    for number, planned in enumerate(plan_actions(rows, r0_m=measured.r0_m, limits=limits)):
        times_s = np.arange(0.0, planned.end_s + max(coast_s, 0.0), measured.period_s)
        nowhere = np.full((len(times_s), 2), np.nan)
        factors = action_factors(planned.action.as_array() + 0.0)  # no −0
        casts[number] = SimulatedCast(planned.tool, times_s, factors=factors)
        records.append(Record(number, number, times_s, nowhere, factors))
    return Further(model.of_casts(casts), tuple(records))


def draw_field(inquiry: Inquiry, left: Unexplained) -> dict[str, Any] | None:
    """Return the field over the board or over one number; None for one that cannot be drawn."""
    field = inquiry.model.effects[left.field or ""]
    if isinstance(field, PlaceField):
        x, y = np.meshgrid(np.linspace(*BOARD_X_M), np.linspace(*BOARD_Y_M))
        points = np.stack([x.ravel(), y.ravel()], axis=1)
        axes, values = ["x [m]", "y [m]"], field.at(points, strengths(inquiry, left))
    elif isinstance(field, AlongMotionField):
        unit = {"speed": "m/s", "time": "s"}[field.depends_on or ""]
        axes, points = [f"{field.depends_on} [{unit}]"], field.at_values[:, None]
        values = -strengths(inquiry, left)[:, None]
    else:
        return None
    return {
        "acts_on": "the endpoint" if field.endpoint else "the whole cable",
        "endpoint": bool(field.endpoint),
        "axes": axes,
        "unit": "m/s²",
        "points": points.round(3).tolist(),
        "values": values.round(3).tolist(),
    }
