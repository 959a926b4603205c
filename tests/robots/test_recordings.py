"""LeRobot datasets and ROS 2 bags are read as logs are."""

import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from robotcast.robots.describe import describe
from robotcast.robots.robot_case import read_case
from tests.robots.made_up_robot import ARM, write_folder

JOINTS, DRIVES = ("shoulder", "elbow"), ("s", "e")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """An arm's folder without robot.yaml."""
    folder = write_folder(tmp_path / "arm", ARM, logs=3)
    (folder / "robot.yaml").unlink()
    return folder


def arrays(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times, positions and commands of a CSV log, which goes."""
    table = pl.read_csv(path)
    path.unlink()
    return (
        table["t"].to_numpy(),
        table.select(f"q_{j}" for j in JOINTS).to_numpy(),
        table.select(f"u_{d}" for d in DRIVES).to_numpy(),
    )


def test_episodes_of_a_dataset_are_logs(folder: Path) -> None:
    parts = []
    for number, path in enumerate(sorted(folder.glob("*.csv"))):
        times_s, places, commands = arrays(path)
        part = {"observation.state": places.tolist(), "action": commands.tolist()}
        parts.append(pl.DataFrame({**part, "timestamp": times_s, "episode_index": number}))
    data = folder / "data/chunk-000"
    data.mkdir(parents=True)
    pl.concat(parts).write_parquet(data / "file-000.parquet")
    features = {name: {"names": {"motors": JOINTS}} for name in ("observation.state", "action")}
    (folder / "meta").mkdir()
    (folder / "meta/info.json").write_text(json.dumps({"features": features}))
    describe(folder)
    case = read_case(folder)
    assert [log.path.name[-2:] for log in case.model.rollout.logs] == ["#0", "#1", "#2"]
    assert list(case.robot.measured.values())[1].name == "observation.state.elbow"
    assert list(case.robot.drive.values())[1].name == "action.elbow"


STATES = """std_msgs/Header header
string[] name
float64[] position
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec"""
COMMANDS = "float64[] data"


def test_a_bag_is_read_through_its_own_library(folder: Path) -> None:
    writer_of = pytest.importorskip("mcap_ros2.writer").Writer
    for path in sorted(folder.glob("*.csv")):
        times_s, places, commands = arrays(path)
        with path.with_suffix(".mcap").open("wb") as file:
            writer = writer_of(file)
            states = writer.register_msgdef("sensor_msgs/msg/JointState", STATES)
            targets = writer.register_msgdef("std_msgs/msg/Float64MultiArray", COMMANDS)
            for time_s, place, command in zip(times_s, places, commands, strict=True):
                stamp_ns = round(1e9 * (100.0 + time_s))
                stamp = {"sec": stamp_ns // 10**9, "nanosec": stamp_ns % 10**9}
                state = {"header": {"stamp": stamp, "frame_id": ""}, "name": list(JOINTS)}
                state |= {"position": place.tolist()}
                told = {"log_time": stamp_ns, "publish_time": stamp_ns}
                writer.write_message("/command", targets, {"data": command.tolist()}, **told)
                writer.write_message("/joint_states", states, state, **told)
            writer.finish()
    describe(folder)
    case = read_case(folder)
    measured, driven = case.robot.measured.values(), case.robot.drive.values()
    assert [c.name for c in measured] == [f"/joint_states.position.{j}" for j in JOINTS]
    assert [c.name for c in driven] == ["/command.data[0]", "/command.data[1]"]
