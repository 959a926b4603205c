"""The two processes that run ur_rtde: `python -m robotcast.rigs.ur5.client listen|drive SOCKET`.

ur_rtde is native code with threads of its own: it can wait for ever on a silent controller, it
reconnects by itself after a broken connection and sends its last command again, and it has crashed
while a connection broke. Here it can be ended at any moment, and with it every socket over which
a target could go: whoever wants the arm left alone ends the one process that drives. Orders
arrive over the socket whose number is the last argument.
"""

import json
import sys
import time
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

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
TARGET_BYTES = 6 * 8
BRAKE_RAD_S2 = 10.0
PAUSE_S = 0.0003  # a cycle is noticed so late at most


def listen(orders: Connection) -> None:
    """Hear the controller until the other end is closed.

    The first order is the controller's host; its answer is "" once states arrive, or what went
    wrong. Every further order is a time of the controller's clock, eight bytes: the answer is the
    newest state after it, as soon as there is one, and "" when the connection was lost. Packets
    that come in a burst, after a hiccup of the network, count as one: the last of them is
    answered, so that no burst of targets answers them.
    """
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
        if receive.getTimestamp() != newest[0]:
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


def drive(orders: Connection) -> None:
    """Tell the arm targets until the other end is closed.

    A host and servo settings begin a program on the controller, six numbers are a target, an
    empty order ends the program. The answer to the first and the last is "" or what went wrong;
    a target is answered only when it was refused.
    """
    control, settings = None, {}
    while True:
        order = orders.recv_bytes()
        if len(order) == TARGET_BYTES and control is not None:
            target = np.frombuffer(order).tolist()
            servo = settings["period_s"], settings["lookahead_s"], settings["gain"]
            if not control.servoJ(target, 0.0, 0.0, *servo):
                orders.send_bytes(b"the program on the controller no longer takes targets")
        elif order:
            settings = json.loads(order)
            try:
                control = _begin_program(settings)
            except (RuntimeError, ValueError) as error:
                orders.send_bytes(str(error).strip().encode() or b"no reason given")
                return
            orders.send_bytes(b"")
        elif control is not None:
            control.servoStop(BRAKE_RAD_S2)
            control.stopScript()
            control.disconnect()
            control = None
            orders.send_bytes(b"")


def _begin_program(settings: dict[str, Any]) -> Any:
    """Start the program that follows targets; return ur_rtde's control interface."""
    from rtde_control import RTDEControlInterface  # an optional extra

    control = RTDEControlInterface(settings["host"])
    if not control.setTcp([0.0, 0.0, settings["tool_m"], 0.0, 0.0, 0.0]):
        raise RuntimeError("the controller did not accept the tool")
    if not control.setWatchdog(settings["watchdog_hz"]):
        raise RuntimeError("the controller did not accept the watchdog")
    return control


if __name__ == "__main__":
    try:
        {"listen": listen, "drive": drive}[sys.argv[1]](Connection(int(sys.argv[2])))
    except (EOFError, BrokenPipeError, ConnectionResetError):
        sys.exit(0)
