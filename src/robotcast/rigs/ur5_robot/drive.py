"""Telling the arm targets, through a process that is ended at the first trouble."""

import json
import socket
import subprocess
import sys
from contextlib import suppress
from dataclasses import asdict, dataclass
from multiprocessing.connection import Connection

import numpy as np

from robotcast.rigs.rig import RigStopped

BEGIN_S, END_S = 30.0, 15.0


@dataclass(frozen=True)
class ServoSettings:
    """How servoj follows its targets, and when the controller gives up waiting for one.

    Attributes
    ----------
    lookahead_s : in [0.03, 0.2], smooths the targets.
    gain : in [100, 2000], proportional gain of following them.
    watchdog_hz : the program on the controller ends when targets come more seldom.
    """

    lookahead_s: float = 0.03
    gain: float = 500.0
    watchdog_hz: float = 10.0


class Drive:
    """The process that may tell the arm targets; it is started once and used motion by motion."""

    def __init__(self) -> None:
        ours, theirs = socket.socketpair()
        module = "robotcast.rigs.ur5_robot.drive_main"
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-m", module, str(theirs.fileno())],
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,  # ur_rtde writes what the sentences here say better
                stderr=subprocess.DEVNULL,
            )
        self._orders = Connection(ours.detach())

    def begin(self, host: str, tool_m: float, period_s: float, servo: ServoSettings) -> None:
        """Start the program on the controller."""
        told = {"host": host, "tool_m": tool_m, "period_s": period_s, **asdict(servo)}
        self._send(json.dumps(told).encode())
        if refusal := self._answer(BEGIN_S):
            raise RigStopped(f"the program did not start on the controller ({refusal})")

    def tell(self, joints_rad: np.ndarray) -> None:
        """Send the next target (6,)."""
        target = np.asarray(joints_rad, dtype=float)
        if target.shape != (6,) or not np.isfinite(target).all():
            raise RigStopped("a target that is no number was about to be sent")
        if self._orders.poll():
            raise RigStopped(self._answer(0.0))
        self._send(target.tobytes())

    def end(self) -> None:
        """Let the arm come to a stop and end the program on the controller."""
        self._send(b"")
        if refusal := self._answer(END_S):
            raise RigStopped(refusal)

    def kill(self) -> None:
        """End the process, whatever it is doing."""
        self._process.kill()
        self._process.wait()
        self._orders.close()

    def _send(self, order: bytes) -> None:
        with suppress(OSError):  # whether it still lives shows when it is asked
            self._orders.send_bytes(order)
            return
        raise RigStopped("the process that tells the arm its targets ended")

    def _answer(self, patience_s: float) -> str:
        try:
            if self._orders.poll(patience_s):
                return self._orders.recv_bytes().decode(errors="replace")
        except (EOFError, OSError):
            raise RigStopped("the process that tells the arm its targets ended") from None
        raise RigStopped(f"the controller did not answer within {patience_s:.0f} s")
