"""The arm as a rig uses it: running checked motions at the controller's rate, watched every cycle.

The controller's own clock paces the stream: a target answers each cycle. A cycle that got no
target in time is counted; the motion then goes on with the next target, never skipping one, so
that no two targets in a row lie further apart than planned.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from robotcast.casts.tool_motion import ToolMotion
from robotcast.rigs import RigStopped
from robotcast.rigs.kinematics import Gripper, link_points
from robotcast.rigs.ur5.controller import Drive, Robot, RobotState
from robotcast.rigs.ur5.motion import JointMotion, held_pose
from robotcast.sessions import write_columns

PLAYING = 2  # runtime_state of Universal Robots' RTDE guide
FULL_SPEED = 0.99  # of the pendant's slider
SETTLE_S = 0.3  # for which the end of a motion is held


@dataclass(frozen=True)
class WatchSettings:
    """When a running motion is stopped."""

    stale_s: float = 0.15  # longest time without a new cycle of the controller
    off_path_m: float = 0.05  # furthest that the tool may be from its path …
    lag_s: float = 0.4  # … of so long before


@dataclass
class RobotLog:
    """What the controller reported while targets were sent, a state for every target."""

    states: list[RobotState] = field(default_factory=list)
    missed: int = 0  # cycles without a target in time, while the arm had to move
    cycles: int = 0  # of the controller while the arm had to move

    def column(self, name: str) -> np.ndarray:
        """Return one attribute of the states, (n,) or (n, 6)."""
        return np.array([getattr(state, name) for state in self.states])

    def controller_time(self, heard_s: np.ndarray) -> np.ndarray:
        """Return the controller's time at moments of this computer's clock."""
        return np.interp(heard_s, self.column("heard_s"), self.column("t_s"))

    def write(self, path: Path) -> None:
        """Write robot.csv: t [s] by the controller's clock, joints [rad], tool [m, rad], safety."""
        vectors = {
            "joints_rad": [f"actual{i}" for i in range(6)],
            "target_rad": [f"told{i}" for i in range(6)],
            "tool_pose": ["x", "y", "z", "rx", "ry", "rz"],
        }
        columns = {"t": self.column("t_s"), "heard": self.column("heard_s")}
        for attribute, names in vectors.items():
            columns |= dict(zip(names, self.column(attribute).reshape(-1, 6).T, strict=True))
        write_columns(columns | {"safety_bits": self.column("safety_bits")}, path)

    def tool_motion(self, start_s: float) -> ToolMotion:
        """Return the held end's motion from the controller's time `start_s` on, as it reported it.

        The place is the controller's own, whose kinematics is calibrated; the yaw is the
        difference of base and wrist 3, which is exact while the tool points down.
        """
        joints, tool = self.column("joints_rad"), self.column("tool_pose")
        yaw = np.unwrap(joints[:, 0] - np.pi / 2 - joints[:, 5])
        yaw -= 2 * np.pi * np.round(yaw[0] / (2 * np.pi))
        t_s = self.column("t_s") - start_s
        begun = t_s >= -1e-9
        return ToolMotion(t_s[begun], np.column_stack([tool[:, :2], yaw])[begun])


@dataclass(frozen=True)
class Arm:
    """A robot that holds a cable.

    `require_alive` is called in every cycle of a motion; it raises `RigStopped` when the rig may
    not go on.
    """

    robot: Robot
    gripper: Gripper
    watch: WatchSettings
    require_alive: Callable[[], None]

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
        settled = motion.part(slice(-1, None)).held(0.0, SETTLE_S, self.robot.period_s)
        self.follow([motion, settled], RobotLog())

    def follow(
        self,
        motions: Sequence[JointMotion],
        log: RobotLog,
        every_cycle: Callable[[], None] = lambda: None,
        before: Callable[[int], None] = lambda index: None,
    ) -> None:
        """Run motions that were checked, one right after the other, and log every cycle.

        `every_cycle` is called beside `require_alive`, `before` with the index of a motion before
        it starts.
        """
        with self.robot.driving() as drive:
            for index, motion in enumerate(motions):
                before(index)
                self._stream(drive, motion, log, every_cycle)

    def _stream(
        self, drive: Drive, motion: JointMotion, log: RobotLog, every_cycle: Callable[[], None]
    ) -> None:
        """Send every target of `motion`, right after those in `log`; nothing after any trouble."""
        robot, settings = self.robot, self.watch
        path_m = link_points(motion.joints_rad, self.gripper)[:, -1]
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
            if state.trouble:
                raise RigStopped(f"{state.trouble} of the robot")
            if state.runtime != PLAYING:
                raise RigStopped(
                    "the program on the controller ended (stopped there, or its watchdog)"
                )
            recent_m = path_m[max(0, index - window) : index + 1]
            away_m = np.linalg.norm(recent_m - state.tool_pose[:3], axis=1).min()
            if not away_m <= settings.off_path_m:
                raise RigStopped(f"the tool is {away_m * 1e3:.0f} mm off its path")
            self.require_alive()
            every_cycle()
            drive.command(target)
