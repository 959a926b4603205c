"""What a worker process of the PyBullet simulator does (see `workers`)."""

from collections.abc import Callable
from functools import partial

import pybullet

from robotcast.simulators.bullet.run import BulletRun
from robotcast.simulators.bullet.settings import PARAMETERS
from robotcast.simulators.bullet.tasks import Setup, Task
from robotcast.simulators.planar import simulate_planar
from robotcast.simulators.simulator import Prediction

FINER = 2  # by how much the step of a run that diverged is cut


def prepare(setup: Setup) -> Callable[[Task], Prediction]:
    """Open this process's physics client; return what simulates a cast in it."""
    client = pybullet.connect(pybullet.DIRECT)
    steps = (setup.settings.step_s, setup.settings.step_s / FINER)
    starts = [
        (step_s, partial(BulletRun, client, setup.cable, setup.settings, step_s))
        for step_s in steps
    ]

    def answer(task: Task) -> Prediction:
        return simulate_planar(
            starts if task.retry else starts[:1],
            [task.cast],
            task.vector,
            n_parameters=len(PARAMETERS),
            effects=setup.effects,
            batch_size=1,
            threads=1,
        )

    return answer
