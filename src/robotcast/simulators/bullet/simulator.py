"""PyBullet's cable: capsules joined by 6-degree-of-freedom springs on a plane.

Paper, "Three Simulation Models": PyBullet, with its ten tuned parameters. Bodies, contacts,
friction, damping and joints are Bullet's own, in three dimensions. How the cable is made of
them follows from how PyBullet 3.2.7 works (its C++ sources, and runs beside the segmented
simulator):

- Its springs with six degrees of freedom exist for rigid bodies only, no call sets their
  stiffness, they push explicitly, and they soften in silence what is too stiff for the step
  (btGeneric6DofSpring2Constraint). Motors do not stand in: their gains scale with the mass that
  they move. So a point-to-point constraint holds the three displacements, and bending and
  twisting springs push as torques, computed before every step. They are explicit too, and their
  stiffness is what its name says: the step is cut until the fastest mode of the springs is well
  sampled. An implicit torque would let a bent cable that friction holds go slack, because
  friction is not known before the step.
- The capsules are separate bodies, not the links of one: with 18 spherical joints such a step took
  ten times as long and more.
- Friction between two rigid bodies is limited apart along and across their motion, so that what
  slides one way can hardly be pushed aside. Against a plane that is a multi-body Bullet limits
  the two together, as Coulomb's law has it, and the cable moves as the segmented one does.
- Bullet multiplies the lateral frictions of two bodies. The plane's is `dynamic_friction`, the
  endpoint's 1, the capsules' `lateral_friction`: the first scales all friction, the second that
  of the cable beside the endpoint's. Spinning friction acts only where there is rolling
  friction, whose bounds therefore exclude 0.
- The springs have no damping of their own: what stills the cable's fast flutter is the angular
  damping of the capsules. An explicit damper as strong as a cable's needs a step tens of times
  shorter, so effects that damp bending are refused.
"""

import os
from collections.abc import Sequence

import numpy as np

from robotcast.effects.effect import Effect
from robotcast.fitting.parameter import Parameter
from robotcast.measurements.measurement_set import Cable
from robotcast.processes.workers import Workers
from robotcast.progress import Progress, silent
from robotcast.simulators.bullet.settings import PARAMETERS, BulletSettings
from robotcast.simulators.bullet.tasks import Setup, Task
from robotcast.simulators.checks import all_parameters
from robotcast.simulators.simulator import Cast, Prediction, SimulatedCast


class BulletSimulator:
    """Capsules on a plane in PyBullet, in worker processes with a physics client each."""

    name = "bullet"
    tunes = ("bending_damping",)  # as the capsules' angular damping
    lacks = ("damping_time", "extra_length")  # hooks of effects, see above

    def __init__(
        self,
        cable: Cable,
        parameters: Sequence[Parameter],
        settings: BulletSettings,
        effects: Sequence[Effect] = (),
    ) -> None:
        self.parameters = all_parameters(
            self.name, PARAMETERS, parameters, effects, self.tunes, self.lacks
        )
        self.cable = cable
        self.effects = tuple(effects)
        self.settings = settings
        self._workers = Workers(
            "robotcast.simulators.bullet.worker:prepare",
            Setup(cable, settings, self.effects),
            settings.processes or len(os.sched_getaffinity(0)),
            settings.patience_s,
        )

    def simulate(
        self,
        casts: Sequence[Cast],
        vectors: np.ndarray,
        *,
        retry: bool = True,
        progress: Progress = silent,
    ) -> Prediction:
        """Simulate every cast under every parameter vector (see `Simulator`)."""
        vectors = np.atleast_2d(np.asarray(vectors, dtype=float))
        if vectors.shape[1] != len(self.parameters):
            raise ValueError(
                f"expected {len(self.parameters)} parameters a vector, got {vectors.shape[1]}"
            )
        sent = [SimulatedCast(c.tool, c.waypoints_s, c.start_m, c.factors) for c in casts]
        tasks = [Task(cast, vector, retry) for vector in vectors for cast in sent]
        answers = self._workers.answer(tasks, progress)
        k_max = max((len(c.waypoints_s) for c in casts), default=0)
        waypoints_m = np.full((len(vectors) * len(casts), k_max, 2), np.nan)
        for row, answer in zip(waypoints_m, answers, strict=True):
            seen_m = answer.waypoints_m[0, 0]
            row[: len(seen_m)] = seen_m
        diverged = np.array([answer.diverged[0, 0] for answer in answers], dtype=bool)
        shape = (len(vectors), len(casts))
        return Prediction(waypoints_m.reshape(*shape, k_max, 2), diverged.reshape(shape))
