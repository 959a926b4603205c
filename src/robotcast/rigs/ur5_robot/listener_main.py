"""The process that hears the controller: `python -m robotcast.rigs.ur5_robot.listener_main`.

The first order over the socket whose number is the argument is the controller's host; its answer
is "" once states arrive, or what went wrong. Every further order is a time of the controller's
clock, eight bytes: the answer is the newest state after it, as soon as there is one, and "" when
the connection was lost. Packets that come in a burst, after a hiccup of the network, count as one:
the last of them is answered, so that no burst of targets answers them.
"""

import sys
import time
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from robotcast.rigs.ur5_robot.listener import VARIABLES

PAUSE_S = 0.0003  # a cycle is noticed so late at most


def listen(orders: Connection) -> None:
    """Answer orders until the other end is closed."""
    from rtde_receive import RTDEReceiveInterface  # an optional extra

    host = orders.recv_bytes().decode()
    try:
        receive = RTDEReceiveInterface(host, variables=list(VARIABLES))
    except (RuntimeError, ValueError) as error:
        orders.send_bytes(str(error).strip().encode() or b"no reason given")
        return
    newest = _state(receive)
    orders.send_bytes(b"")
    wanted_s = np.inf
    while True:
        came = receive.getTimestamp() != newest[0]
        if came:
            newest = _state(receive)
        elif newest[0] > wanted_s + 1e-6:
            orders.send_bytes(newest.tobytes())
            wanted_s = np.inf
        if not receive.isConnected():
            orders.send_bytes(b"")
            return
        if orders.poll(PAUSE_S):
            wanted_s = float(np.frombuffer(orders.recv_bytes())[0])


def _state(receive: Any) -> np.ndarray:
    """Return a whole cycle as `RobotState.from_numbers` takes it, none mixed of two."""
    while True:
        t_s, heard_s = receive.getTimestamp(), time.monotonic()
        vectors = (receive.getActualQ(), receive.getTargetQ(), receive.getActualTCPPose())
        speed, runtime = receive.getTargetSpeedFraction(), receive.getRuntimeState()
        rest = [speed, runtime, receive.getSafetyStatusBits()]
        if receive.getTimestamp() == t_s:
            return np.concatenate([[t_s, heard_s], *vectors, rest])


if __name__ == "__main__":
    try:
        listen(Connection(int(sys.argv[1])))
    except (EOFError, BrokenPipeError, ConnectionResetError):
        sys.exit(0)
