"""The arm: its controller's state, and checked motions at its rate, watched every cycle.

The controller's own clock paces the stream: a target answers each cycle. A cycle that got no
target in time is counted; the motion then goes on with the next target, never skipping one, so
that no two targets in a row lie further apart than planned.
"""

import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from robotcast.casts.action import ToolMotion
from robotcast.processes import helper_process
from robotcast.rigs import RigStopped
from robotcast.rigs.kinematics import Gripper, link_points
from robotcast.rigs.ur5.client import RobotState, drive, listen
from robotcast.rigs.ur5.motion import JointMotion, held_pose
from robotcast.sessions import write_columns

FIRST_S, ARRIVAL_S = 20.0, 5.0  # for a state: of a new connection, and while nothing moves
BEGIN_S, END_S = 30.0, 15.0  # for the program on the controller to start and to stop
PERIODS = 40  # looked at for the shortest, even on a busy computer
DASHBOARD_PORT, DASHBOARD_S = 29999, 2.0
PLAYING = 2  # runtime_state of Universal Robots' RTDE guide
FULL_SPEED = 0.99  # of the pendant's slider
SETTLE_S = 0.3  # for which the end of a motion is held


@dataclass(frozen=True)
class ServoSettings:
    """How servoj follows its targets, and when the controller gives up waiting for one."""

    lookahead_s: float = 0.03  # in [0.03, 0.2], smooths the targets
    gain: float = 500.0  # in [100, 2000], proportional gain of following them
    watchdog_hz: float = 10.0  # the controller's program ends when targets come more seldom


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
        """Return one field of the states, (n,) or (n, 6)."""
        return np.array([getattr(state, name) for state in self.states])

    def controller_time(self, heard_s: np.ndarray) -> np.ndarray:
        """Return the controller's time at moments of this computer's clock."""
        return np.interp(heard_s, self.column("heard_s"), self.column("t_s"))

    def write(self, path: Path) -> None:
        """Write robot.csv: t [s] by the controller's clock, joints [rad], tool [m, rad], safety."""
        columns = {"t": self.column("t_s"), "heard": self.column("heard_s")}
        for attribute, names in (
            ("joints_rad", [f"actual{i}" for i in range(6)]),
            ("target_rad", [f"told{i}" for i in range(6)]),
            ("tool_pose", ["x", "y", "z", "rx", "ry", "rz"]),
        ):
            columns |= dict(zip(names, self.column(attribute).reshape(-1, 6).T, strict=True))
        write_columns(columns | {"safety_bits": self.column("safety_bits")}, path)

    def tool_motion(self, start_s: float) -> ToolMotion:
        """Return the held end's motion from the controller's time `start_s` on, as it reported it.

        The yaw is the difference of base and wrist 3, exact while the tool points down.
        """
        joints, tool = self.column("joints_rad"), self.column("tool_pose")
        yaw = np.unwrap(joints[:, 0] - np.pi / 2 - joints[:, 5])
        yaw -= 2 * np.pi * np.round(yaw[0] / (2 * np.pi))
        t_s = self.column("t_s") - start_s
        begun = t_s >= -1e-9
        return ToolMotion(t_s[begun], np.column_stack([tool[:, :2], yaw])[begun])


class _Client:
    """A process of `client`, at the other end of a connection."""

    def __init__(self, work: Callable[..., None], task: str) -> None:
        self._ended = f"the process that {task} ended"
        self._process, self._orders = helper_process(work)

    def send(self, order: Any) -> None:
        try:
            self._orders.send(order)
        except OSError:
            raise RigStopped(self._ended) from None

    def answer(self, patience_s: float) -> Any:
        """Wait for an answer; None when none came in time."""
        try:
            return self._orders.recv() if self._orders.poll(patience_s) else None
        except (EOFError, OSError):
            raise RigStopped(self._ended) from None

    def obey(self, order: Any, patience_s: float) -> None:
        """Wait until an order is obeyed; raise `RigStopped` when it is refused."""
        self.send(order)
        if (refusal := self.answer(patience_s)) is None:
            raise RigStopped(f"the controller did not answer within {patience_s:.0f} s")
        if refusal:
            raise RigStopped(refusal)

    def kill(self) -> None:
        """End the process, whatever it is doing."""
        self._process.kill()
        self._process.join()
        self._orders.close()


class Arm:
    """A UR arm that holds a cable: heard all the time, and driven now and then.

    `require_alive` is called in every cycle of a motion; it raises `RigStopped` when the rig may
    not go on. `period_s` is the controller's cycle: 8 ms of a CB3, 2 ms of an e-Series.
    """

    def __init__(
        self,
        host: str,
        gripper: Gripper,
        servo: ServoSettings,
        watch: WatchSettings,
        require_alive: Callable[[], None] = lambda: None,
    ) -> None:
        require_ur_rtde()
        self.host, self.gripper, self.servo, self.watch = host, gripper, servo, watch
        self.require_alive = require_alive
        self._driver: _Client | None = None
        self._listener = _Client(listen, "hears the controller")
        try:
            self._listener.obey(host, FIRST_S)
            seen_s = [-np.inf]
            for _ in range(PERIODS + 1):
                seen_s.append(self.next_state(seen_s[-1], ARRIVAL_S).t_s)
        except RigStopped as stop:
            self._listener.kill()
            raise ValueError(
                f"no UR controller answers at rig.host={host} ({stop}); "
                "check the cable, the address and that the robot is switched on"
            ) from None
        self.period_s = 0.008 if np.diff(seen_s[1:]).min() > 0.006 else 0.002

    def next_state(self, last_s: float, patience_s: float) -> RobotState:
        """Wait for a cycle later than `last_s`; raise `RigStopped` when none comes in time."""
        self._listener.send(last_s)
        if (answer := self._listener.answer(patience_s)) is None:
            self._listener.kill()  # what it would still send answers nothing that is asked later
            raise RigStopped(
                f"the controller sent nothing new for {patience_s * 1e3:.0f} ms "
                "(stale or missing packets)"
            )
        if not answer:
            raise RigStopped(f"the connection to the controller at {self.host} was lost")
        return answer

    def live(self) -> RobotState:
        """Return the present state; raise when it is not fresh."""
        return self.next_state(self.next_state(-np.inf, ARRIVAL_S).t_s, ARRIVAL_S)

    def start(self) -> np.ndarray:
        """Return the live joints (6,) of an arm that may start; raise `RigStopped` otherwise."""
        state = self.live()
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
        self.follow(motion.held(0.0, SETTLE_S, self.period_s), RobotLog())

    def follow(
        self, motion: JointMotion, log: RobotLog, every_cycle: Callable[[], None] = lambda: None
    ) -> None:
        """Run a motion that was checked; log every cycle, and do `every_cycle` in it.

        After any trouble nobody is left to send a target.
        """
        path_m = link_points(motion.joints_rad, self.gripper)[:, -1]
        moving = (motion.joints_rad != motion.joints_rad[0]).any(axis=1)
        window = int(np.ceil(self.watch.lag_s / self.period_s))
        with self._driving() as driver:
            for index, target in enumerate(motion.joints_rad):
                last_s = log.states[-1].t_s if log.states else -np.inf
                state = self.next_state(last_s, self.watch.stale_s)
                if log.states and moving[index]:
                    cycles = round((state.t_s - last_s) / self.period_s)
                    log.cycles += cycles
                    log.missed += cycles - 1
                log.states.append(state)
                self._require_sound(state, path_m[max(0, index - window) : index + 1])
                every_cycle()
                if target.shape != (6,) or not np.isfinite(target).all():
                    raise RigStopped("a target that is no number was about to be sent")
                if (refused := driver.answer(0.0)) is not None:
                    raise RigStopped(refused)
                driver.send(target.tolist())

    def _require_sound(self, state: RobotState, recent_m: np.ndarray) -> None:
        """Raise `RigStopped` unless arm and rig are well and the tool is near its recent path."""
        if state.trouble:
            raise RigStopped(f"{state.trouble} of the robot")
        if state.runtime != PLAYING:
            raise RigStopped("the program on the controller ended (stopped there, or its watchdog)")
        away_m = np.linalg.norm(recent_m - state.tool_pose[:3], axis=1).min()
        if not away_m <= self.watch.off_path_m:
            raise RigStopped(f"the tool is {away_m * 1e3:.0f} mm off its path")
        self.require_alive()

    def stop(self) -> None:
        """End whatever program runs, over the dashboard's own connection; the arm brakes."""
        address = (self.host, DASHBOARD_PORT)
        with suppress(OSError), socket.create_connection(address, DASHBOARD_S) as dashboard:
            dashboard.recv(256)  # its greeting
            dashboard.sendall(b"stop\n")
            dashboard.recv(256)

    def close(self) -> None:
        if self._driver is not None:
            self._driver.kill()
            self._driver = None
        self._listener.kill()

    @contextmanager
    def _driving(self) -> Iterator[_Client]:
        """Run the program that follows targets, in a process that is kept for the next motion."""
        driver = self._driver = self._driver or _Client(drive, "tells the arm its targets")
        tool = {"host": self.host, "tool_m": self.gripper.length_m, "period_s": self.period_s}
        try:
            driver.obey(tool | asdict(self.servo), BEGIN_S)
            yield driver
            driver.obey(None, END_S)
        except BaseException:
            driver.kill()
            self._driver = None
            self.stop()
            raise


def require_ur_rtde() -> None:
    """Raise ValueError, saying what to install, unless ur_rtde is there."""
    try:
        import rtde_control  # noqa: F401
        import rtde_receive  # noqa: F401
    except ImportError:
        raise ValueError(
            "rig=ur5 needs ur_rtde, which is not installed: pip install 'robotcast[ur5]'"
        ) from None
