"""The work of the two processes that run ur_rtde: one hears the controller, one drives the arm.

ur_rtde is native code with threads of its own: it can wait for ever on a silent controller, it
reconnects by itself after a broken connection and sends its last command again, and it has crashed
while a connection broke. Here it can be ended at any moment, and with it every socket over which
a target could go: whoever wants the arm left alone ends the one process that drives.
"""

import os
import time
from multiprocessing.connection import Connection
from typing import Any, NamedTuple

import numpy as np

VARIABLES = "timestamp actual_q target_q actual_TCP_pose target_speed_fraction runtime_state "
VARIABLES += "robot_status_bits safety_status_bits"
SAFETY_BITS = (
    *("protective stop", "recovery mode", "safeguard stop", "system emergency stop"),
    *("robot emergency stop", "emergency stop", "safety violation", "safety fault"),
)
"""Bits of safety_status_bits, from bit 2 on, that mean that the arm may not move, worst last."""
BRAKE_RAD_S2 = 10.0
PAUSE_S = 0.0003  # a cycle is noticed so late at most


class RobotState(NamedTuple):
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


def listen(orders: Connection) -> None:
    """Hear the controller until the other end is closed.

    The first order is the controller's host; its answer is "" once states arrive, or what went
    wrong. Every further order is a time of the controller's clock: the answer is the newest
    `RobotState` after it, as soon as there is one, and "" when the connection was lost. Of packets
    that come in a burst the last is answered, so that no burst of targets answers them.
    """
    _silence()
    from rtde_receive import RTDEReceiveInterface  # an optional extra

    try:
        receive = RTDEReceiveInterface(orders.recv(), variables=VARIABLES.split())
    except (RuntimeError, ValueError) as error:
        orders.send(str(error).strip() or "no reason given")
        return
    newest = _state(receive)
    orders.send("")
    wanted_s = np.inf
    while True:
        if receive.getTimestamp() != newest.t_s:
            newest = _state(receive)
        elif newest.t_s > wanted_s + 1e-6:
            orders.send(newest)
            wanted_s = np.inf
        if not receive.isConnected():
            orders.send("")
            return
        if orders.poll(PAUSE_S):
            wanted_s = orders.recv()


def _state(receive: Any) -> RobotState:
    """Return a whole cycle, none mixed of two."""
    while True:
        t_s, heard_s = receive.getTimestamp(), time.monotonic()
        vectors = (receive.getActualQ(), receive.getTargetQ(), receive.getActualTCPPose())
        joints, target, tool = map(np.array, vectors)
        speed, runtime = receive.getTargetSpeedFraction(), receive.getRuntimeState()
        safety = receive.getSafetyStatusBits()
        if receive.getTimestamp() == t_s:
            return RobotState(t_s, heard_s, joints, target, tool, speed, int(runtime), int(safety))


def drive(orders: Connection) -> None:
    """Command the arm targets until the other end is closed.

    A dict of host, tool and servo settings begins a program on the controller, six numbers are a
    target, None ends the program. The answer to the first and the last is "" or what went wrong;
    a target is answered only when it was refused.
    """
    _silence()
    control, servo = None, ()
    while True:
        order = orders.recv()
        if isinstance(order, dict):
            servo = order["period_s"], order["lookahead_s"], order["gain"]
            try:
                control = _begin_program(order)
            except (RuntimeError, ValueError) as error:
                reason = str(error).strip() or "no reason given"
                orders.send(f"the program did not start on the controller ({reason})")
                return
            orders.send("")
        elif control is None:
            orders.send("no program runs on the controller")
        elif order is None:
            control.servoStop(BRAKE_RAD_S2)
            control.stopScript()
            control.disconnect()
            control = None
            orders.send("")
        elif not control.servoJ(order, 0.0, 0.0, *servo):
            orders.send("the program on the controller no longer takes targets")


def _begin_program(settings: dict[str, Any]) -> Any:
    """Start the program that follows targets; return ur_rtde's control interface."""
    from rtde_control import RTDEControlInterface  # an optional extra

    control = RTDEControlInterface(settings["host"])
    if not control.setTcp([0.0, 0.0, settings["tool_m"], 0.0, 0.0, 0.0]):
        raise RuntimeError("the controller did not accept the tool")
    if not control.setWatchdog(settings["watchdog_hz"]):
        raise RuntimeError("the controller did not accept the watchdog")
    return control


def _silence() -> None:
    """Write nowhere: what ur_rtde writes the session's own sentences say better."""
    for stream in (1, 2):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
