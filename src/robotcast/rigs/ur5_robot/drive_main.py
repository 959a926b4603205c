"""The only process that can tell the arm anything: `python -m robotcast.rigs.ur5_robot.drive_main`.

It stands apart because ur_rtde reconnects by itself after a broken connection, sends its last
command again, and may wait for ever for packets: whoever wants the arm left alone ends this
process, and with it every socket over which a target could go.

Orders come over the socket whose number is the first argument: a host and servo settings begin a
program on the controller, six numbers are a target, an empty order ends the program. The answer
to the first and the last is "" or what went wrong; a target is answered only when it was refused.
"""

import json
import sys
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

TARGET_BYTES = 6 * 8
BRAKE_RAD_S2 = 10.0


def begin(told: dict[str, Any]) -> Any:
    """Start the program that follows targets; return ur_rtde's control interface."""
    from rtde_control import RTDEControlInterface  # an optional extra

    control = RTDEControlInterface(told["host"])
    if not control.setTcp([0.0, 0.0, told["tool_m"], 0.0, 0.0, 0.0]):
        raise RuntimeError("the controller did not accept the tool")
    if not control.setWatchdog(told["watchdog_hz"]):
        raise RuntimeError("the controller did not accept the watchdog")
    return control


def obey(orders: Connection) -> None:
    """Do what is ordered until the other end is closed."""
    control, told = None, {}
    while True:
        order = orders.recv_bytes()
        if len(order) == TARGET_BYTES and control is not None:
            target = np.frombuffer(order).tolist()
            servo = told["period_s"], told["lookahead_s"], told["gain"]
            if not control.servoJ(target, 0.0, 0.0, *servo):
                orders.send_bytes(b"the program on the controller no longer takes targets")
        elif order:
            told = json.loads(order)
            try:
                control = begin(told)
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


if __name__ == "__main__":
    try:
        obey(Connection(int(sys.argv[1])))
    except EOFError:
        sys.exit(0)
