"""Starting a peer in a process of its own, and giving it orders from a test."""

import multiprocessing
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.rigs.peer.controller import Log, Settings
from tests.rigs.peer.server import Server, listen

if TYPE_CHECKING:
    from robotcast.rigs.virtual.rig import VirtualRig

FIRST_HOST, HOSTS = 2, 200
ROBOT_FAULTS = (
    "protective stop",
    "emergency stop",
    "connection cut",
    "stale packets",
    "packets missing",
    "off its path",
)


class Peer:
    """A running peer at the loopback address `host`, its video at `camera`, "" without one."""

    def __init__(self, host: str, camera: str, orders: Connection) -> None:
        self.host, self.camera, self._orders = host, camera, orders

    def break_now(self, kind: str) -> None:
        """Have one of ROBOT_FAULTS, "camera gone" or "cable crooked"."""
        self._order("break", kind)

    def break_in(self, kind: str, delay_s: float) -> None:
        """Have a fault so many seconds of the controller's time from now."""
        self._order("break in", kind, delay_s)

    def hurry(self, duration_s: float) -> None:
        """Go through so much time at once, as if the client had been held up."""
        self._order("hurry", duration_s)

    def mend(self) -> None:
        """Be as an operator leaves it who cleared the fault; the arm stays where it is."""
        self._order("mend")

    def place(self, joints_rad: np.ndarray) -> None:
        """Move the arm by hand."""
        self._order("place", np.asarray(joints_rad))

    def log(self) -> Log:
        return self._order("log")

    def _order(self, *order: Any) -> Any:
        self._orders.send(order)
        return self._orders.recv()


@contextmanager
def running_peer(
    settings: Settings, filmed: "VirtualRig | None" = None, delay_s: float = 0.0
) -> Iterator[Peer]:
    """Run a peer at a free loopback address, with the camera, so late, of a rig if one is given."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(settings, filmed, delay_s, theirs), daemon=True)
    process.start()
    theirs.close()  # so that a peer that could not start ends the waiting
    try:
        host, camera = ours.recv()
        yield Peer(host, camera, ours)
    finally:
        with suppress(OSError):
            ours.send(("end",))
            process.join(5.0)
        process.kill()


def _listen_somewhere() -> tuple[str, list[socket.socket]]:
    for number in range(FIRST_HOST, FIRST_HOST + HOSTS):
        host = f"127.0.0.{number}"
        with suppress(OSError):
            return host, listen(host)
    raise OSError("peer: every loopback address is taken")


def _serve(
    settings: Settings, filmed: "VirtualRig | None", delay_s: float, orders: Connection
) -> None:
    (host, sockets), shown = _listen_somewhere(), None
    if filmed is not None:
        from tests.rigs.peer.film import Film  # brings a simulator, a peer without one starts soon

        shown = Film(filmed, delay_s, host)
    server = Server(sockets, settings, orders, shown)
    orders.send((host, "" if shown is None else shown.address))
    server.run()
