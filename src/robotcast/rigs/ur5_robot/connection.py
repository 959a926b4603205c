"""The connection to a UR controller through ur_rtde: its state, its dashboard, and the drive."""

import importlib
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import pairwise

from robotcast.rigs.rig import RigStopped
from robotcast.rigs.ur5_robot.drive import Drive, ServoSettings
from robotcast.rigs.ur5_robot.listener import Listener, RobotState

ARRIVAL_S = 5.0  # for a state while nothing moves
PERIODS = 40  # looked at for the shortest, even on a busy computer
DASHBOARD_PORT, DASHBOARD_S = 29999, 2.0


class Robot:
    """A controller whose state is received all the time, and that is driven now and then.

    Attributes
    ----------
    period_s : of the controller's cycle, 8 ms of a CB3, 2 ms of an e-Series.
    """

    def __init__(self, host: str, tool_m: float, servo: ServoSettings) -> None:
        require_ur_rtde()
        self.host, self._tool_m, self._servo = host, tool_m, servo
        self._drive: Drive | None = None
        self._listener = Listener(host)
        try:
            self.period_s = self._measured_period()
        except RigStopped:
            self.close()
            raise

    def next_state(self, last_s: float | None, patience_s: float) -> RobotState:
        """Wait for a cycle later than `last_s`; raise `RigStopped` when none comes in time."""
        return self._listener.next_state(last_s, patience_s)

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
        address = (self.host, DASHBOARD_PORT)
        with suppress(OSError), socket.create_connection(address, DASHBOARD_S) as dashboard:
            dashboard.recv(256)  # its greeting
            dashboard.sendall(b"stop\n")
            dashboard.recv(256)

    def close(self) -> None:
        """Hang up."""
        if self._drive is not None:
            self._drive.kill()
            self._drive = None
        self._listener.kill()

    def _measured_period(self) -> float:
        """Return the controller's cycle: the shortest step of its time stamps [s]."""
        seen_s = [self.next_state(None, ARRIVAL_S).t_s]
        for _ in range(PERIODS):
            seen_s.append(self.next_state(seen_s[-1], ARRIVAL_S).t_s)
        shortest_s = min(after - before for before, after in pairwise(seen_s))
        return 0.008 if shortest_s > 0.006 else 0.002


def require_ur_rtde() -> None:
    """Raise ValueError, saying what to install, unless ur_rtde is there."""
    for name in ("rtde_control", "rtde_receive"):
        try:
            importlib.import_module(name)
        except ImportError:
            raise ValueError(
                "rig=ur5 needs ur_rtde, which is not installed: pip install 'robotcast[ur5]'"
            ) from None
