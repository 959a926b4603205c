"""The connection to a UR controller through ur_rtde: its state, its dashboard, and the drive."""

import importlib
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from types import ModuleType

import numpy as np

from robotcast.rigs.rig import RigStopped
from robotcast.rigs.ur5_robot.drive import Drive, ServoSettings

ARRIVAL_S = 5.0  # for a state while nothing moves
PLAYING = 2  # runtime_state of Universal Robots' RTDE guide
VARIABLES = (
    "timestamp",
    "actual_q",
    "target_q",
    "actual_TCP_pose",
    "target_speed_fraction",
    "runtime_state",
    "robot_status_bits",
    "safety_status_bits",
)
SAFETY_BITS = {
    2: "protective stop",
    3: "recovery mode",
    4: "safeguard stop",
    5: "system emergency stop",
    6: "robot emergency stop",
    7: "emergency stop",
    8: "safety violation",
    9: "safety fault",
}
"""Bits of safety_status_bits that mean that the arm may not move, worst last."""


@dataclass(frozen=True)
class RobotState:
    """One cycle of the controller.

    Attributes
    ----------
    t_s : by the controller's clock.
    heard_s : when it arrived, by this computer's monotonic clock.
    joints_rad, told_rad : ndarrays of shape (6,), actual and target.
    tool_pose : ndarray of shape (6,), the controller's tool centre point and rotation vector.
    """

    t_s: float
    heard_s: float
    joints_rad: np.ndarray
    told_rad: np.ndarray
    tool_pose: np.ndarray
    speed_fraction: float
    runtime: int
    safety_bits: int

    @property
    def trouble(self) -> str:
        """Why the arm may not move, "" when it may."""
        found = [text for bit, text in SAFETY_BITS.items() if self.safety_bits >> bit & 1]
        return found[-1] if found else ""


class Robot:
    """A controller whose state is received all the time, and that is driven now and then."""

    def __init__(self, host: str, tool_m: float, servo: ServoSettings) -> None:
        self.host, self._tool_m, self._servo = host, tool_m, servo
        self._drive: Drive | None = None
        rtde_receive = _module("rtde_receive")
        try:
            self._receive = rtde_receive.RTDEReceiveInterface(host, variables=list(VARIABLES))
        except RuntimeError as error:
            raise ValueError(_unreachable(host, error)) from None
        first = self.next_state(None, ARRIVAL_S)
        self.period_s = self._measured_period(first)

    def next_state(self, last_s: float | None, patience_s: float) -> RobotState:
        """Wait for a cycle later than `last_s`; raise `RigStopped` when none comes in time."""
        until = time.monotonic() + patience_s
        while True:
            if not self._receive.isConnected():
                raise RigStopped(f"the connection to the controller at {self.host} was lost")
            state = self._whole_state()
            if state is not None and (last_s is None or state.t_s > last_s + 1e-6):
                return state
            if time.monotonic() > until:
                raise RigStopped(
                    f"the controller sent nothing new for {patience_s * 1e3:.0f} ms "
                    "(stale or missing packets)"
                )
            time.sleep(0.0003)

    def live(self) -> RobotState:
        """Return the present state; raise when it is not fresh."""
        seen = self.next_state(None, ARRIVAL_S)
        return self.next_state(seen.t_s, ARRIVAL_S)

    @contextmanager
    def driving(self) -> Iterator[Drive]:
        """Run the program that follows targets; after any trouble nobody is left to send one."""
        drive = self._drive or Drive()
        self._drive = drive
        try:
            drive.begin(self.host, self._tool_m, self.period_s, self._servo)
            yield drive
            drive.end()
        except BaseException:
            drive.kill()
            self._drive = None
            self.stop()
            raise

    def stop(self) -> None:
        """End whatever program runs, over the dashboard's own connection; the arm brakes."""
        with suppress(Exception):
            dashboard = _module("dashboard_client").DashboardClient(self.host)
            dashboard.connect(500)
            dashboard.stop()
            dashboard.disconnect()

    def close(self) -> None:
        """Hang up."""
        if self._drive is not None:
            self._drive.kill()
            self._drive = None
        with suppress(Exception):
            self._receive.disconnect()

    def _whole_state(self) -> RobotState | None:
        """Return the last cycle, None when the next one came while it was read."""
        receive = self._receive
        try:
            t_s = receive.getTimestamp()
            state = RobotState(
                t_s,
                time.monotonic(),
                np.array(receive.getActualQ()),
                np.array(receive.getTargetQ()),
                np.array(receive.getActualTCPPose()),
                receive.getTargetSpeedFraction(),
                receive.getRuntimeState(),
                receive.getSafetyStatusBits(),
            )
            return state if receive.getTimestamp() == t_s else None
        except RuntimeError as error:
            raise RigStopped(f"the controller's state cannot be read ({error})") from None

    def _measured_period(self, state: RobotState) -> float:
        """Return the controller's cycle: the shortest step of its time stamps."""
        steps = []
        for _ in range(10):
            later = self.next_state(state.t_s, ARRIVAL_S)
            steps.append(later.t_s - state.t_s)
            state = later
        return 0.008 if min(steps) > 0.006 else 0.002


def require_ur_rtde() -> None:
    """Raise ValueError, saying what to install, unless ur_rtde is there."""
    for name in ("rtde_control", "rtde_receive", "dashboard_client"):
        _module(name)


def _module(name: str) -> ModuleType:
    try:
        return importlib.import_module(name)
    except ImportError:
        raise ValueError(
            "rig=ur5 needs ur_rtde, which is not installed: pip install 'robotcast[ur5]'"
        ) from None


def _unreachable(host: str, error: Exception) -> str:
    return (
        f"no UR controller answers at rig.host={host} ({str(error).strip()}); "
        "check the cable, the address and that the robot is switched on"
    )
