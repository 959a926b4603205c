"""A cast simulator as a `Model` that diagnosis can question."""

from collections.abc import Callable, Collection, Mapping, Sequence
from copy import copy
from dataclasses import replace

import numpy as np

from robotcast.diagnosis.model import Record
from robotcast.effects.effect import Effect
from robotcast.fitting.parameter import Parameter
from robotcast.measurements.measurement_set import MeasurementSet
from robotcast.simulators.simulator import Cast, SimulatedCast, Simulator

MakeSimulator = Callable[[Sequence[Effect]], Simulator]


class CastModel:
    """Predicts the free end's waypoints of measured casts.

    Parameters
    ----------
    make_simulator : makes the simulator with some effects active.
    effects : the candidates, fields included.
    held : names of the simulator's parameters that stay at their nominal values.
    """

    error_unit = "% of cable length"

    def __init__(
        self,
        measured: MeasurementSet,
        make_simulator: MakeSimulator,
        effects: Sequence[Effect],
        held: Collection[str] = (),
    ) -> None:
        self.effects: Mapping[str, Effect] = {effect.name: effect for effect in effects}
        self.scale = measured.cable.length_m
        self._casts: Mapping[int, Cast] = {trial.trial: trial for trial in measured.trials}
        self._make_simulator = make_simulator
        self._simulators: dict[tuple[str, ...], Simulator] = {}
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
        asked = [(self._casts[record.trial], record.times_s) for record in records]
        casts = [
            SimulatedCast(cast.tool, times_s, cast.start_m, cast.factors) for cast, times_s in asked
        ]
        simulator, one = self._simulator(tuple(active)), len(vectors) == 1
        return simulator.simulate(casts, vectors, retry=one).waypoints_m

    def of_casts(self, casts: Mapping[int, Cast]) -> "CastModel":
        """Return the same model, which predicts other casts, by their number."""
        other = copy(self)
        other._casts = casts
        return other

    def _simulator(self, active: tuple[str, ...]) -> Simulator:
        if active not in self._simulators:
            self._simulators[active] = self._make_simulator([self.effects[name] for name in active])
        return self._simulators[active]
