"""What the controller reports, cycle by cycle, through a process that receives it."""

from dataclasses import dataclass

import numpy as np

from robotcast.rigs.rig import RigStopped
from robotcast.rigs.ur5_robot.helper import Helper

FIRST_S = 20.0
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
NUMBERS = 2 + 3 * 6 + 3
"""What a state holds: t_s, heard_s, three vectors, speed fraction, runtime state, safety bits."""

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

    @classmethod
    def from_numbers(cls, numbers: np.ndarray) -> "RobotState":
        """Return the state that stands in an ndarray of shape (NUMBERS,)."""
        t_s, heard_s = numbers[:2].tolist()
        joints, told, tool = numbers[2:20].reshape(3, 6)
        speed, runtime, safety = numbers[20:].tolist()
        return cls(t_s, heard_s, joints, told, tool, speed, int(runtime), int(safety))

    @property
    def trouble(self) -> str:
        """Why the arm may not move, "" when it may."""
        found = [text for bit, text in SAFETY_BITS.items() if self.safety_bits >> bit & 1]
        return found[-1] if found else ""


class Listener:
    """The process that hears every cycle of the controller at `host`."""

    def __init__(self, host: str) -> None:
        self._host = host
        self._helper = Helper("listener_main", "hears the controller")
        try:
            self._helper.send(host.encode())
            answer = self._helper.answer(FIRST_S)
        except RigStopped as stop:
            self._helper.kill()
            raise ValueError(_unreachable(host, str(stop))) from None
        if answer != b"":
            self._helper.kill()
            why = "it sends no state" if answer is None else answer.decode(errors="replace")
            raise ValueError(_unreachable(host, why))

    def next_state(self, last_s: float | None, patience_s: float) -> RobotState:
        """Wait for a cycle later than `last_s`; raise `RigStopped` when none comes in time."""
        self._helper.send(np.float64(-np.inf if last_s is None else last_s).tobytes())
        answer = self._helper.answer(patience_s)
        if answer is None:
            self._helper.kill()  # what it would still send answers nothing that is asked later
            raise RigStopped(
                f"the controller sent nothing new for {patience_s * 1e3:.0f} ms "
                "(stale or missing packets)"
            )
        if not answer:
            raise RigStopped(f"the connection to the controller at {self._host} was lost")
        return RobotState.from_numbers(np.frombuffer(answer))

    def kill(self) -> None:
        """Hear no more."""
        self._helper.kill()


def _unreachable(host: str, why: str) -> str:
    return (
        f"no UR controller answers at rig.host={host} ({why.strip()}); "
        "check the cable, the address and that the robot is switched on"
    )
