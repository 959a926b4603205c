"""Recorded casts: the session that collects them append-only, and the files of each.

A session is a folder of one rig with one cable; session.yaml names both and holds what the tracker
may know. Each finished cast is a folder `cast_00007` that appears in one step, so a session killed
at any moment holds whole casts only. The number of a cast is its action's id, plus 10000 for every
time the action was asked for before: it stays the same whatever else is asked for, and so does
the cast. A session may hold a copy of a recorded measurement set in place of casts.
"""

import fcntl
import filecmp
import os
import shutil
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import polars as pl

from robotcast.casts.action import ACTION_COLUMNS, Action, ToolMotion, action_factors
from robotcast.casts.table import RANGES, TABLE_COLUMNS, Table, read_table
from robotcast.files import atomic_folder, discard_unfinished, read_mapping, write_text, write_yaml
from robotcast.measurements.measurement_set import Cable, MeasurementSet
from robotcast.measurements.reader import read_measurement_set

SESSION_FILE, REQUEST_FILE = "session.yaml", "request.yaml"
CAST_FILE, TOOL_FILE, VIDEO_FILE, TRUTH_FILE = "cast.yaml", "tool.csv", "video.mp4", "truth.csv"
FRAMES_FILE, ROBOT_NOTES_FILE = "frames.csv", "robot.yaml"
RECORDED_COPY = "measurements"
CODEC = "mp4v"
MOST_ACTIONS = 10_000
SETTING_NAMES = {"made": "make of the rig (its settings, its seed)", "vision": "camera"}


@dataclass(frozen=True)
class CastRequest:
    """A cast that was asked for; casts that repeat an action share its `action_id`."""

    number: int
    action_id: int
    action: Action

    @property
    def folder_name(self) -> str:
        return f"cast_{self.number:05d}"


@dataclass(frozen=True)
class Session:
    """A session folder as it is."""

    folder: Path
    rig: str
    cable: Cable
    r0_m: float
    facts: dict[str, Any] = field(default_factory=dict)  # plain numbers for the tracker, by block
    casts: tuple[CastRequest, ...] = ()  # the finished ones by number
    broken: dict[str, str] = field(default_factory=dict)  # folder → why it holds no cast

    def cast_folder(self, cast: CastRequest) -> Path:
        return self.folder / cast.folder_name


@dataclass(frozen=True)
class CastRecord:
    """cast.yaml: what was executed, by which rig, and when the video runs."""

    number: int
    action: Action
    rig: str
    cable: str
    video_t0_s: float  # when the exposure of the first frame begins; 0 is the cast's start
    fps: float
    turn_s: float  # of the planned motion, as is end_s
    end_s: float
    rest_s: float  # when the rig saw the cable at rest
    rest_only: bool


def number_requests(actions: Sequence[tuple[int, Action]]) -> list[CastRequest]:
    """Give each (action_id, action) the number of its cast."""
    seen: Counter[int] = Counter()
    requests = []
    for action_id, action in actions:
        if not 0 <= action_id < MOST_ACTIONS:
            raise ValueError(f"session: action ids must be in [0, {MOST_ACTIONS}), got {action_id}")
        requests.append(CastRequest(action_id + MOST_ACTIONS * seen[action_id], action_id, action))
        seen[action_id] += 1
    return requests


def open_session(
    folder: Path, *, rig: str, cable: Cable, r0_m: float, facts: dict[str, Any]
) -> Session:
    """Start a session, or return the one in `folder` if it is of the same rig and cable."""
    values = {"rig": rig, "cable": asdict(cable), "r0_m": float(r0_m), **facts}
    path = folder / SESSION_FILE
    if not path.is_file():
        write_yaml(path, values)
    elif (known := _load(path)) != values:
        changed = sorted(
            SETTING_NAMES.get(k, k) for k in {*known, *values} if known.get(k) != values.get(k)
        )
        raise ValueError(
            f"{folder}: this session was begun with another {' and another '.join(changed)}; "
            "a session is never rewritten: move it away or collect elsewhere (paths.sessions=…)"
        )
    return read_session(folder)


def read_session(folder: Path) -> Session:
    path = folder / SESSION_FILE
    if not path.is_file():
        raise ValueError(f"{folder}: no {SESSION_FILE}; not a session, collect writes one")
    casts, broken = [], {}
    for entry in sorted(folder.glob("cast_*")):
        if entry.is_dir():
            try:
                casts.append(_read_request(entry))
            except ValueError as error:
                broken[entry.name] = str(error)
    with _whole(path) as values:
        rig, cable = str(values.pop("rig")), Cable(**values.pop("cable"))
        r0_m = float(values.pop("r0_m"))
    return Session(folder, rig, cable, r0_m, facts=values, casts=tuple(casts), broken=broken)


def _read_request(folder: Path) -> CastRequest:
    with _whole(folder / REQUEST_FILE) as values:
        action = _action(values["action"])
        request = CastRequest(int(values["number"]), int(values["action_id"]), action)
    if folder.name != request.folder_name:
        raise ValueError(f"{folder}: holds {request.folder_name}; a copy is no cast")
    return request


def missing_requests(session: Session, requests: Sequence[CastRequest]) -> list[CastRequest]:
    """Return the requests that are not finished; refuse a number that holds another action."""
    finished = {cast.number: cast for cast in session.casts}
    missing = []
    for request in requests:
        if request.folder_name in session.broken:
            raise ValueError(f"{session.broken[request.folder_name]}; move that folder away")
        cast = finished.get(request.number)
        if cast is None:
            missing.append(request)
            continue
        held, asked = cast.action.as_array(), request.action.as_array()
        if not np.allclose(held, asked, atol=1e-9):
            held, asked = (", ".join(f"{v:.4g}" for v in numbers) for numbers in (held, asked))
            raise ValueError(
                f"{session.cast_folder(cast)}: holds another action than the one asked for under "
                f"this number ({held} instead of {asked}); a finished cast is never replaced: "
                "move the session away or collect elsewhere (paths.sessions=…)"
            )
    return missing


@contextmanager
def exclusive(folder: Path) -> Iterator[None]:
    """Keep other collectors out of a session folder, and clear what a killed one left behind."""
    folder.mkdir(parents=True, exist_ok=True)
    handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise ValueError(f"{folder}: another process is collecting into this session") from None
        discard_unfinished(folder)
        yield
    finally:
        os.close(handle)


def write_record(record: CastRequest | CastRecord, folder: Path) -> None:
    """Write request.yaml or cast.yaml of a cast."""
    path = folder / (REQUEST_FILE if isinstance(record, CastRequest) else CAST_FILE)
    values = {**vars(record), "action": action_factors(record.action.as_array())}
    write_yaml(path, values)


def read_record(folder: Path) -> CastRecord:
    with _whole(folder / CAST_FILE) as values:
        return CastRecord(action=_action(values.pop("action")), **values)


def video_writer(path: Path, fps: float, width: int, height: int) -> cv2.VideoWriter:
    """Open a video file for frames (height, width, 3), uint8; who calls releases it."""
    fourcc = cv2.VideoWriter.fourcc(*CODEC)
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, fourcc, fps, (width, height))
    if not writer.isOpened():
        raise OSError(f"{path}: OpenCV cannot write {CODEC} video of {width} × {height} px")
    return writer


def write_columns(columns: Mapping[str, np.ndarray], path: Path) -> None:
    """Write a CSV table, seven digits after the point."""
    write_text(path, pl.DataFrame(columns).write_csv(float_precision=7))


def write_tool(tool: ToolMotion, path: Path) -> None:
    """Write a tool log: t [s], x [m], y [m], yaw [rad]."""
    x, y, yaw = tool.pose.T
    write_columns({"t": tool.t_s, "x": x, "y": y, "yaw": yaw}, path)


def read_tool(path: Path) -> ToolMotion:
    """Read the tool log of a cast."""
    table = read_table(path, TABLE_COLUMNS["tool"][1:])
    t_s, *pose = table.columns.values()
    if len(t_s) < 2:
        raise ValueError(f"{path}: holds {len(t_s)} samples, expected at least 2")
    _refuse_clock(table, t_s)
    return ToolMotion(t_s, np.stack(pose, axis=1))


def _refuse_clock(table: Table, t_s: np.ndarray) -> None:
    """Refuse times (k,) that do not increase; NaN is no time."""
    known = np.flatnonzero(np.isfinite(t_s))
    stuck = np.zeros(len(t_s), dtype=bool)
    stuck[known[1:]] = np.diff(t_s[known]) <= 0
    table.refuse_where(
        stuck, lambda i: f"t is {t_s[i]:g} and not above the t before it: the clock began again"
    )


def write_frame_times(t_s: np.ndarray, folder: Path) -> None:
    """Write when the middle of each frame's exposure was, (k,) [s]; NaN where nobody knows."""
    write_columns({"t": t_s}, folder / FRAMES_FILE)


def read_frame_times(record: CastRecord, exposure_s: float, count: int, folder: Path) -> np.ndarray:
    """Return when the middle of each of a video's `count` frames was exposed, (count,) [s].

    Without a file of them they are evenly spaced, as `video_t0_s` and `fps` say.
    """
    path = folder / FRAMES_FILE
    if not path.is_file():
        return record.video_t0_s + exposure_s / 2 + np.arange(count) / record.fps
    try:
        t_s = pl.read_csv(path, schema={"t": pl.Float64})["t"].to_numpy()
    except pl.exceptions.PolarsError as error:
        raise ValueError(f"{path}: {str(error).splitlines()[0]}") from None
    if len(t_s) != count:
        raise ValueError(f"{path}: holds {len(t_s)} times for {count} frames")
    table, within = Table(path, {"t": t_s}, np.arange(2, 2 + count)), RANGES["t"]
    table.refuse_where(
        np.abs(t_s) > within.most,
        lambda i: f"t is {t_s[i]:g}, beyond {within.most:g} s; {within.mistaken}",
    )
    _refuse_clock(table, t_s)
    return t_s


def summed_robot_notes(session: Session) -> dict[str, Any]:
    """Return what robot.yaml of all casts say together, {} when the rig wrote none."""
    paths = [session.cast_folder(cast) / ROBOT_NOTES_FILE for cast in session.casts]
    notes = []
    for path in filter(Path.is_file, paths):
        with suppress(ValueError):  # a cast that was cut is lost to the tracker
            notes.append(_load(path))
    if not notes:
        return {}
    return {
        "camera_offset_s": sorted({n["camera_offset_s"] for n in notes}),
        "kinematic_difference_m": max(n["kinematic_difference_m"] for n in notes),
        "missed_deadlines": sum(n["missed_deadlines"] for n in notes),
        "cycles": sum(n["cycles"] for n in notes),
        "casts_with_missed_deadlines": sum(n["missed_deadlines"] > 0 for n in notes),
    }


def adopt_recorded_set(path: Path | None, folder: Path) -> MeasurementSet:
    """Validate the set in `path` and make `folder` a session that holds a copy of it."""
    if not path:
        raise ValueError("rig=recorded needs the folder of a measurement set: rig.path=DIR")
    if not path.is_dir():
        raise ValueError(f"rig.path={path}: no such folder; expected one with a measurement set")
    measured, copy = read_measurement_set(path), folder / RECORDED_COPY
    if copy.is_dir():
        names = sorted({entry.name for entry in (*_set_files(path), *_set_files(copy))})
        _, changed, lost = filecmp.cmpfiles(path, copy, names, shallow=False)
        if changed or lost:
            raise ValueError(
                f"{folder}: this session holds another recorded set than {path} "
                f"(differs in {', '.join(changed + lost)}); use another folder (paths.sessions=…)"
            )
    elif (folder / SESSION_FILE).exists():
        raise ValueError(
            f"{folder}: this session holds casts of the rig {read_session(folder).rig}; "
            "give the recorded set a folder of its own (paths.sessions=…)"
        )
    else:
        with atomic_folder(copy) as unfinished:
            for entry in _set_files(path):
                shutil.copyfile(entry, unfinished / entry.name)
    values = {"rig": "recorded", "cable": asdict(measured.cable), "r0_m": measured.r0_m}
    write_yaml(folder / SESSION_FILE, values)
    return measured


def recorded_copy(folder: Path) -> Path | None:
    """Return the measurement set that a session passes on, None when it holds casts of a rig."""
    return folder / RECORDED_COPY if (folder / RECORDED_COPY).is_dir() else None


def _set_files(folder: Path) -> list[Path]:
    return sorted(p for p in folder.iterdir() if p.suffix in (".yaml", ".csv", ".parquet"))


def _action(numbers: Mapping[str, Any]) -> Action:
    return Action(*(float(numbers[name]) for name in ACTION_COLUMNS))


def _load(path: Path) -> dict[str, Any]:
    try:
        return read_mapping(path, "what collect writes; it is cut or empty")
    except FileNotFoundError:
        raise ValueError(f"{path}: is missing; collect writes it with every cast") from None
    except OSError as error:
        raise ValueError(f"{path}: cannot be read ({error.strerror})") from None


@contextmanager
def _whole(path: Path) -> Iterator[dict[str, Any]]:
    """Yield the values of a file; refuse it where something is missing."""
    values = _load(path)
    try:
        yield values
    except (KeyError, TypeError, ValueError) as error:
        why = f": {error} is missing" if isinstance(error, KeyError) else ""
        raise ValueError(f"{path}: is cut, or was not written by collect{why}") from None
