"""The files of one recorded cast, the same for every rig."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl
import yaml

from robotcast.casts.action import ACTION_COLUMNS, Action
from robotcast.casts.tool_motion import ToolMotion
from robotcast.files import atomic_file, write_text

CAST_FILE, TOOL_FILE, VIDEO_FILE, TRUTH_FILE = "cast.yaml", "tool.csv", "video.mp4", "truth.csv"
FRAMES_FILE = "frames.csv"


@dataclass(frozen=True)
class CastRecord:
    """cast.yaml: what was told, by which rig, and when the video runs.

    Attributes
    ----------
    video_t0_s : when the exposure of the video's first frame begins; 0 is the cast's start.
    turn_s, end_s : of the planned motion.
    rest_s : when the rig saw the cable at rest.
    """

    number: int
    action: Action
    rig: str
    cable: str
    video_t0_s: float
    fps: float
    turn_s: float
    end_s: float
    rest_s: float
    rest_only: bool


def write_record(record: CastRecord, folder: Path) -> None:
    """Write cast.yaml into `folder`."""
    numbers = {
        name: float(value)
        for name, value in zip(ACTION_COLUMNS, record.action.as_array(), strict=True)
    }
    text = yaml.safe_dump({**vars(record), "action": numbers}, sort_keys=False)
    write_text(folder / CAST_FILE, text)


def read_record(folder: Path) -> CastRecord:
    """Read cast.yaml of a finished cast."""
    path = folder / CAST_FILE
    if not path.is_file():
        raise ValueError(f"{path}: missing; not the folder of a finished cast")
    values = yaml.safe_load(path.read_text(encoding="utf-8"))
    numbers = values.pop("action")
    action = Action(*(float(numbers[name]) for name in ACTION_COLUMNS))
    return CastRecord(action=action, **values)


def write_tool(tool: ToolMotion, path: Path) -> None:
    """Write a tool log: t [s], x [m], y [m], yaw [rad]."""
    x, y, yaw = tool.pose.T
    with atomic_file(path) as temporary:
        pl.DataFrame({"t": tool.t_s, "x": x, "y": y, "yaw": yaw}).write_csv(
            temporary, float_precision=7
        )


def read_tool(path: Path) -> ToolMotion:
    """Read a tool log that `write_tool` wrote."""
    if not path.is_file():
        raise ValueError(f"{path}: missing; the tool was not logged")
    table = pl.read_csv(path)
    return ToolMotion(table["t"].to_numpy(), table.select("x", "y", "yaw").to_numpy())


def write_frame_times(t_s: np.ndarray, folder: Path) -> None:
    """Write when the middle of each frame's exposure was, (k,) [s]; NaN where nobody knows.

    A rig whose frames are evenly spaced needs no such file: `video_t0_s` and `fps` say it.
    """
    with atomic_file(folder / FRAMES_FILE) as temporary:
        pl.DataFrame({"t": t_s}).write_csv(temporary, float_precision=7)


def read_frame_times(record: CastRecord, exposure_s: float, count: int, folder: Path) -> np.ndarray:
    """Return when the middle of each of a video's `count` frames was exposed, (count,) [s]."""
    path = folder / FRAMES_FILE
    if not path.is_file():
        return record.video_t0_s + exposure_s / 2 + np.arange(count) / record.fps
    t_s = pl.read_csv(path, schema={"t": pl.Float64})["t"].to_numpy()
    if len(t_s) != count:
        raise ValueError(f"{path}: holds {len(t_s)} times for {count} frames")
    return t_s
