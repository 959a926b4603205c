"""A simulator whose cable is a planar chain, whatever its joints."""

from collections.abc import Sequence
from functools import partial
from typing import ClassVar

import numpy as np

from robotcast.effects.effect import Effect
from robotcast.fitting.parameter import Parameter
from robotcast.measurements.measurement_set import Cable
from robotcast.progress import Progress, silent
from robotcast.simulators.chain.run import ChainRun, ChainSettings, implicitly_damped
from robotcast.simulators.checks import all_parameters
from robotcast.simulators.geometry import ChainGeometry
from robotcast.simulators.planar import simulate_planar
from robotcast.simulators.simulator import Cast, Prediction

FINER = 2  # by how much the step of a run that diverged is cut


class ChainSimulator:
    """Simulates casts in batches of chains; a model names its parameters and its kind of run.

    Attributes
    ----------
    name : of the simulator.
    own : the names of its own parameters, in order.
    tunes : effects that are parameters here.
    run : what steps a batch.
    """

    name: str
    own: ClassVar[tuple[str, ...]]
    tunes: ClassVar[tuple[str, ...]] = ()
    run: ClassVar[type[ChainRun]]

    def __init__(
        self,
        cable: Cable,
        parameters: Sequence[Parameter],
        settings: ChainSettings,
        effects: Sequence[Effect] = (),
    ) -> None:
        self.parameters = all_parameters(self.name, self.own, parameters, effects, self.tunes)
        self.cable = cable
        self.effects = tuple(effects)
        self.settings = settings
        self._geometry = ChainGeometry.of_cable(
            cable.length_m, settings.segments, settings.stretches
        )
        steps = (settings.step_s, settings.step_s / FINER)
        self._models = {s: implicitly_damped(self._geometry, s) for s in steps}

    def simulate(
        self,
        casts: Sequence[Cast],
        vectors: np.ndarray,
        *,
        retry: bool = True,
        progress: Progress = silent,
    ) -> Prediction:
        """Simulate every cast under every parameter vector (see `Simulator`)."""
        starts = [
            (step_s, partial(self.run, self.cable, self._geometry, model, self.settings))
            for step_s, model in self._models.items()
        ]
        return simulate_planar(
            starts if retry else starts[:1],
            casts,
            vectors,
            n_parameters=len(self.own),
            effects=self.effects,
            batch_size=self.settings.batch_size,
            threads=self.settings.threads,
            progress=progress,
        )
