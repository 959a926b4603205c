"""Write a first robot.yaml for a robot's MJCF and logs, and draw a window beside the simulation.

python stages/describe.py robot=FOLDER
"""

from pathlib import Path

from omegaconf import DictConfig

from robotcast.stage import require, stage, tell
from robotcast.workflow.diagnosing_robot import describe_robot


def describe(config: DictConfig) -> None:
    require(config, "robot")
    for sentence in describe_robot(Path(config.robot)):
        tell(sentence)


if __name__ == "__main__":
    stage(describe)()
