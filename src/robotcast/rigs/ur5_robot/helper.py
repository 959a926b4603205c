"""Processes of their own for what talks to the controller.

ur_rtde is native code with threads of its own: it can wait for ever on a silent controller, it
reconnects by itself, and it has crashed while a connection broke. In a process of its own it can
be ended at any moment, and whatever becomes of it, the session it records for lives on.
"""

import socket
import subprocess
import sys
from multiprocessing.connection import Connection

from robotcast.rigs.rig import RigStopped


class Helper:
    """A module of this package that runs as a process, at the other end of a socket.

    Parameters
    ----------
    module : its name; the number of its socket is its only argument.
    task : what it does, for messages.
    """

    def __init__(self, module: str, task: str) -> None:
        self._task = task
        ours, theirs = socket.socketpair()
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-m", f"{__package__}.{module}", str(theirs.fileno())],
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,  # ur_rtde writes what the sentences here say better
                stderr=subprocess.DEVNULL,
            )
        self._socket = Connection(ours.detach())

    def send(self, order: bytes) -> None:
        """Send an order; raise `RigStopped` when the process ended."""
        try:
            self._socket.send_bytes(order)
        except OSError:
            raise self._ended() from None

    def answer(self, patience_s: float) -> bytes | None:
        """Wait for an answer; None when none came in time."""
        try:
            return self._socket.recv_bytes() if self._socket.poll(patience_s) else None
        except (EOFError, OSError):
            raise self._ended() from None

    def kill(self) -> None:
        """End the process, whatever it is doing."""
        self._process.kill()
        self._process.wait()
        self._socket.close()

    def _ended(self) -> RigStopped:
        return RigStopped(f"the process that {self._task} ended")
