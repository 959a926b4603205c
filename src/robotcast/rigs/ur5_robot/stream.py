"""Streaming a motion to the arm at the controller's rate, watching it in every cycle.

The controller's own clock paces the stream: a target answers each cycle. A cycle that got no
target in time is counted; the motion then goes on with the next target, never skipping one, so
that no two targets in a row lie further apart than planned.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from robotcast.rigs.rig import RigStopped
from robotcast.rigs.ur5 import Gripper, link_points
from robotcast.rigs.ur5_robot.connection import Robot
from robotcast.rigs.ur5_robot.drive import Drive
from robotcast.rigs.ur5_robot.listener import RobotState
from robotcast.rigs.ur5_robot.motion import JointMotion

PLAYING = 2  # runtime_state of Universal Robots' RTDE guide


@dataclass(frozen=True)
class WatchSettings:
    """When a running motion is stopped.

    Attributes
    ----------
    stale_s : longest time without a new cycle of the controller.
    off_path_m : furthest that the tool may be from where it was told to be within `lag_s`.
    """

    stale_s: float = 0.15
    off_path_m: float = 0.05
    lag_s: float = 0.4


@dataclass
class RobotLog:
    """What the controller reported while targets were sent, a state for every target.

    Attributes
    ----------
    cycles, missed : of the controller while the arm had to move, and those without a target.
    """

    states: list[RobotState] = field(default_factory=list)
    missed: int = 0
    cycles: int = 0

    def column(self, name: str) -> np.ndarray:
        """Return one attribute of the states, (n,) or (n, 6)."""
        return np.array([getattr(state, name) for state in self.states])

    def controller_time(self, heard_s: np.ndarray) -> np.ndarray:
        """Return the controller's time at moments of this computer's clock."""
        return np.interp(heard_s, self.column("heard_s"), self.column("t_s"))


def stream(
    robot: Robot,
    drive: Drive,
    motion: JointMotion,
    log: RobotLog,
    settings: WatchSettings,
    gripper: Gripper,
    watch: Callable[[], None],
) -> None:
    """Send every target of `motion` and log every cycle; go on at once where `log` ends.

    Raises `RigStopped` at the first sign of trouble, and sends nothing after it.

    Parameters
    ----------
    watch : called in every cycle; raises `RigStopped` when something else is wrong.
    """
    path_m = link_points(motion.joints_rad, gripper)[:, -1]
    moving = (motion.joints_rad != motion.joints_rad[0]).any(axis=1)
    window = int(np.ceil(settings.lag_s / robot.period_s))
    for index, target in enumerate(motion.joints_rad):
        last_s = log.states[-1].t_s if log.states else None
        state = robot.next_state(last_s, settings.stale_s)
        if last_s is not None and moving[index]:
            cycles = round((state.t_s - last_s) / robot.period_s)
            log.cycles += cycles
            log.missed += cycles - 1
        log.states.append(state)
        _refuse_state(state)
        told_m = path_m[max(0, index - window) : index + 1]
        away_m = np.linalg.norm(told_m - state.tool_pose[:3], axis=1).min()
        if not away_m <= settings.off_path_m:
            raise RigStopped(f"the tool is {away_m * 1e3:.0f} mm off its path")
        watch()
        drive.tell(target)


def _refuse_state(state: RobotState) -> None:
    if state.trouble:
        raise RigStopped(f"{state.trouble} of the robot")
    if state.runtime != PLAYING:
        raise RigStopped("the program on the controller ended (stopped there, or its watchdog)")
