"""Tune one simulator's parameters to one cable's casts, or a robot's model to its logs.

python stages/tune.py model=mjcf robot=FOLDER output=DIR [effects=[…]]
"""

from omegaconf import DictConfig

from robotcast.stage import require, stage, tell, warn
from robotcast.workflow.diagnosing_robot import tune_robot
from robotcast.workflow.tuning import tune_simulator


def tune(config: DictConfig) -> None:
    if config.model == "mjcf":
        require(config, "robot", "output")
        for sentence in tune_robot(config):
            tell(sentence)
        return
    folder, tuned = tune_simulator(config)
    test = tuned.errors["test"]
    tell(
        f"{folder}: test casts {test.waypoint_percent:.2f} % average waypoint, "
        f"{test.final_percent:.2f} % median final error, of cable length"
    )
    if tuned.diverged_casts:
        tell(f"{tuned.diverged_casts} of {tuned.simulated_casts} simulated casts diverged")
    for warning in tuned.warnings():
        warn(warning)


if __name__ == "__main__":
    stage(tune)()
