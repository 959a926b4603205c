"""The arm as a rig uses it: where it stands before a motion, and running one to its end."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robotcast.rigs.rig import RigStopped
from robotcast.rigs.ur5 import Gripper
from robotcast.rigs.ur5_robot.connection import Robot
from robotcast.rigs.ur5_robot.motion import JointMotion, held_pose
from robotcast.rigs.ur5_robot.stream import RobotLog, WatchSettings, stream

FULL_SPEED = 0.99  # of the pendant's slider
SETTLE_S = 0.3  # for which the end of a motion is held


@dataclass(frozen=True)
class Arm:
    """A robot that holds a cable.

    Attributes
    ----------
    alive : called in every cycle of a motion; raises `RigStopped` when the rig may not go on.
    """

    robot: Robot
    gripper: Gripper
    watch: WatchSettings
    alive: Callable[[], None]

    def start(self) -> np.ndarray:
        """Return the live joints (6,) of an arm that may start; raise `RigStopped` otherwise."""
        state = self.robot.live()
        if state.trouble:
            raise RigStopped(f"the robot is not ready: {state.trouble}")
        if state.speed_fraction < FULL_SPEED:
            raise RigStopped(
                f"the speed slider stands at {state.speed_fraction:.0%}; set it to 100 %: "
                "it would stretch every cast"
            )
        try:
            held_pose(state.joints_rad, self.gripper)
        except ValueError as error:
            raise RigStopped(str(error)) from None
        return state.joints_rad

    def run(self, motion: JointMotion) -> None:
        """Run a motion that was checked, and wait until the arm stands still."""
        settled = motion.end().held(0.0, SETTLE_S, self.robot.period_s)
        self.follow([motion, settled], RobotLog())

    def follow(
        self,
        motions: list[JointMotion],
        log: RobotLog,
        look: Callable[[], None] | None = None,
        before: Callable[[int], None] | None = None,
    ) -> None:
        """Run motions that were checked, one right after the other, and log every cycle.

        Parameters
        ----------
        look : called in every cycle besides `alive`.
        before : called with the index of a motion before it starts.
        """

        def watch() -> None:
            self.alive()
            if look:
                look()

        with self.robot.driving() as drive:
            for index, motion in enumerate(motions):
                if before:
                    before(index)
                stream(self.robot, drive, motion, log, self.watch, self.gripper, watch)
