"""Telling the arm targets, through a process that is ended at the first trouble."""

import json
from dataclasses import asdict, dataclass

import numpy as np

from robotcast.rigs.rig import RigStopped
from robotcast.rigs.ur5_robot.helper import Helper

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
        self._helper = Helper("drive_main", "tells the arm its targets")

    def begin(self, host: str, tool_m: float, period_s: float, servo: ServoSettings) -> None:
        """Start the program on the controller."""
        told = {"host": host, "tool_m": tool_m, "period_s": period_s, **asdict(servo)}
        self._helper.send(json.dumps(told).encode())
        if refusal := self._refusal(BEGIN_S):
            raise RigStopped(f"the program did not start on the controller ({refusal})")

    def tell(self, joints_rad: np.ndarray) -> None:
        """Send the next target (6,)."""
        target = np.asarray(joints_rad, dtype=float)
        if target.shape != (6,) or not np.isfinite(target).all():
            raise RigStopped("a target that is no number was about to be sent")
        if (refused := self._helper.answer(0.0)) is not None:
            raise RigStopped(refused.decode(errors="replace"))
        self._helper.send(target.tobytes())

    def end(self) -> None:
        """Let the arm come to a stop and end the program on the controller."""
        self._helper.send(b"")
        if refusal := self._refusal(END_S):
            raise RigStopped(refusal)

    def kill(self) -> None:
        """End the process, whatever it is doing."""
        self._helper.kill()

    def _refusal(self, patience_s: float) -> str:
        answer = self._helper.answer(patience_s)
        if answer is None:
            raise RigStopped(f"the controller did not answer within {patience_s:.0f} s")
        return answer.decode(errors="replace")
