"""The connection to a UR controller: its state, its dashboard, and who drives the arm."""

import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from itertools import pairwise
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from robotcast.rigs import RigStopped

FIRST_S, ARRIVAL_S = 20.0, 5.0  # for a state: of a new connection, and while nothing moves
BEGIN_S, END_S = 30.0, 15.0  # for the program on the controller to start and to stop
PERIODS = 40  # looked at for the shortest, even on a busy computer
DASHBOARD_PORT, DASHBOARD_S = 29999, 2.0

SAFETY_BITS = (
    *("protective stop", "recovery mode", "safeguard stop", "system emergency stop"),
    *("robot emergency stop", "emergency stop", "safety violation", "safety fault"),
)
"""Bits of safety_status_bits, from bit 2 on, that mean that the arm may not move, worst last."""


@dataclass(frozen=True)
class ServoSettings:
    """How servoj follows its targets, and when the controller gives up waiting for one."""

    lookahead_s: float = 0.03  # in [0.03, 0.2], smooths the targets
    gain: float = 500.0  # in [100, 2000], proportional gain of following them
    watchdog_hz: float = 10.0  # the controller's program ends when targets come more seldom


@dataclass(frozen=True)
class RobotState:
    """One cycle of the controller."""

    t_s: float  # by the controller's clock
    heard_s: float  # when it arrived, by this computer's monotonic clock
    joints_rad: np.ndarray  # (6,), actual
    target_rad: np.ndarray  # (6,), commanded
    tool_pose: np.ndarray  # (6,), the controller's tool centre point and rotation vector
    speed_fraction: float
    runtime: int
    safety_bits: int

    @property
    def trouble(self) -> str:
        """Why the arm may not move, "" when it may."""
        found = [text for bit, text in enumerate(SAFETY_BITS, 2) if self.safety_bits >> bit & 1]
        return found[-1] if found else ""


class _ClientProcess:
    """A process of `client` in the role `listen` or `drive`, at the other end of a socket."""

    def __init__(self, role: str, task: str) -> None:
        self._ended = f"the process that {task} ended"
        ours, theirs = socket.socketpair()
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-m", f"{__package__}.client", role, str(theirs.fileno())],
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,  # ur_rtde writes what the sentences here say better
                stderr=subprocess.DEVNULL,
            )
        self._socket = Connection(ours.detach())

    def send(self, order: Any) -> None:
        """Send an order; raise `RigStopped` when the process ended."""
        try:
            self._socket.send(order)
        except OSError:
            raise RigStopped(self._ended) from None

    def answer(self, patience_s: float) -> Any:
        """Wait for an answer; None when none came in time."""
        try:
            return self._socket.recv() if self._socket.poll(patience_s) else None
        except (EOFError, OSError):
            raise RigStopped(self._ended) from None

    def kill(self) -> None:
        """End the process, whatever it is doing."""
        self._process.kill()
        self._process.wait()
        self._socket.close()


class Drive(_ClientProcess):
    """The process that may tell the arm targets; it is started once and used motion by motion."""

    def __init__(self) -> None:
        super().__init__("drive", "tells the arm its targets")

    def begin(self, host: str, tool_m: float, period_s: float, servo: ServoSettings) -> None:
        settings = {"host": host, "tool_m": tool_m, "period_s": period_s, **asdict(servo)}
        if refusal := self._done(settings, BEGIN_S):
            raise RigStopped(f"the program did not start on the controller ({refusal})")

    def command(self, joints_rad: np.ndarray) -> None:
        target = np.asarray(joints_rad, dtype=float)
        if target.shape != (6,) or not np.isfinite(target).all():
            raise RigStopped("a target that is no number was about to be sent")
        if (refused := self.answer(0.0)) is not None:
            raise RigStopped(refused)
        self.send(target.tolist())

    def end(self) -> None:
        """Let the arm come to a stop and end the program on the controller."""
        if refusal := self._done(None, END_S):
            raise RigStopped(refusal)

    def _done(self, order: Any, patience_s: float) -> str:
        """Wait until an order is obeyed; return why it was refused, or ""."""
        self.send(order)
        if (answer := self.answer(patience_s)) is None:
            raise RigStopped(f"the controller did not answer within {patience_s:.0f} s")
        return answer


class Robot:
    """A controller whose state is received all the time, and that is driven now and then.

    `period_s` is the controller's cycle: 8 ms of a CB3, 2 ms of an e-Series.
    """

    def __init__(self, host: str, tool_m: float, servo: ServoSettings) -> None:
        require_ur_rtde()
        self.host, self._tool_m, self._servo = host, tool_m, servo
        self._drive: Drive | None = None
        self._listener = _ClientProcess("listen", "hears the controller")
        try:
            self._listener.send(host)
            refusal = self._listener.answer(FIRST_S)
        except RigStopped as stop:
            refusal = str(stop)
        if refusal != "":
            self._listener.kill()
            raise ValueError(
                f"no UR controller answers at rig.host={host} "
                f"({refusal or 'it sends no state'}); "
                "check the cable, the address and that the robot is switched on"
            )
        try:
            seen_s = [self.next_state(None, ARRIVAL_S).t_s]
            for _ in range(PERIODS):
                seen_s.append(self.next_state(seen_s[-1], ARRIVAL_S).t_s)
        except RigStopped:
            self.close()
            raise
        shortest_s = min(after - before for before, after in pairwise(seen_s))
        self.period_s = 0.008 if shortest_s > 0.006 else 0.002

    def next_state(self, last_s: float | None, patience_s: float) -> RobotState:
        """Wait for a cycle later than `last_s`; raise `RigStopped` when none comes in time."""
        self._listener.send(-np.inf if last_s is None else last_s)
        answer = self._listener.answer(patience_s)
        if answer is None:
            self._listener.kill()  # what it would still send answers nothing that is asked later
            raise RigStopped(
                f"the controller sent nothing new for {patience_s * 1e3:.0f} ms "
                "(stale or missing packets)"
            )
        if not answer:
            raise RigStopped(f"the connection to the controller at {self.host} was lost")
        return RobotState(*answer)

    def live(self) -> RobotState:
        """Return the present state; raise when it is not fresh."""
        return self.next_state(self.next_state(None, ARRIVAL_S).t_s, ARRIVAL_S)

    @contextmanager
    def driving(self) -> Iterator[Drive]:
        """Run the program that follows targets; after any trouble nobody is left to send one."""
        drive = self._drive = self._drive or Drive()
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
        address = (self.host, DASHBOARD_PORT)
        with suppress(OSError), socket.create_connection(address, DASHBOARD_S) as dashboard:
            dashboard.recv(256)  # its greeting
            dashboard.sendall(b"stop\n")
            dashboard.recv(256)

    def close(self) -> None:
        if self._drive is not None:
            self._drive.kill()
            self._drive = None
        self._listener.kill()


def require_ur_rtde() -> None:
    """Raise ValueError, saying what to install, unless ur_rtde is there."""
    try:
        import rtde_control  # noqa: F401
        import rtde_receive  # noqa: F401
    except ImportError:
        raise ValueError(
            "rig=ur5 needs ur_rtde, which is not installed: pip install 'robotcast[ur5]'"
        ) from None
