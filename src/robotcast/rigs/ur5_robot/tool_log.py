"""The controller's log as files: robot.csv in full, the tool as other rigs write it."""

from pathlib import Path

import numpy as np
import polars as pl

from robotcast.casts.tool_motion import ToolMotion
from robotcast.files import atomic_file
from robotcast.rigs.ur5_robot.stream import RobotLog

ROBOT_FILE = "robot.csv"


def write_robot_log(log: RobotLog, path: Path) -> None:
    """Write robot.csv: t [s] by the controller's clock, joints [rad], tool place [m], safety."""
    columns: dict[str, np.ndarray] = {"t": log.column("t_s"), "heard": log.column("heard_s")}
    actual, told = (log.column(n).reshape(-1, 6) for n in ("joints_rad", "told_rad"))
    tool = log.column("tool_pose").reshape(-1, 6)
    columns |= {f"actual{i}": actual[:, i] for i in range(6)}
    columns |= {f"told{i}": told[:, i] for i in range(6)}
    columns |= {name: tool[:, i] for i, name in enumerate(("x", "y", "z", "rx", "ry", "rz"))}
    columns["safety_bits"] = log.column("safety_bits")
    with atomic_file(path) as temporary:
        pl.DataFrame(columns).write_csv(temporary, float_precision=7)


def tool_motion(log: RobotLog, start_s: float) -> ToolMotion:
    """Return the held end's motion from the controller's time `start_s` on, as it reported it.

    The place is the controller's own, whose kinematics is calibrated; the yaw is the difference
    of base and wrist 3, which is exact while the tool points down.
    """
    joints, tool = log.column("joints_rad"), log.column("tool_pose")
    yaw = np.unwrap(joints[:, 0] - np.pi / 2 - joints[:, 5])
    yaw -= 2 * np.pi * np.round(yaw[0] / (2 * np.pi))
    t_s = log.column("t_s") - start_s
    begun = t_s >= -1e-9
    return ToolMotion(t_s[begun], np.column_stack([tool[:, :2], yaw])[begun])
