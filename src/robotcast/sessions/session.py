"""A session: the casts of one rig with one cable, collected append-only into a folder.

session.yaml says the rig, the cable and what the tracker may know. Each finished cast is a
folder `cast_00007` that appears in one step, so a session killed at any moment holds whole
casts only. The number of a cast is its action's id, plus 10000 for every time the action was
asked for before: it stays the same whatever else is asked for, and so does the cast.
"""

import fcntl
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from robotcast.casts.action import ACTION_COLUMNS, Action
from robotcast.files import discard_unfinished, write_text
from robotcast.measurements.measurement_set import Cable

SESSION_FILE, REQUEST_FILE = "session.yaml", "request.yaml"
MOST_ACTIONS = 10_000
CHANGED = {"made": "make of the rig (its settings, its seed)", "vision": "camera"}


@dataclass(frozen=True)
class CastRequest:
    """A cast that was asked for; casts that repeat an action share its `action_id`."""

    number: int
    action_id: int
    action: Action

    @property
    def folder_name(self) -> str:
        """Name of the cast's folder in its session."""
        return f"cast_{self.number:05d}"


@dataclass(frozen=True)
class Session:
    """A session folder as it stands.

    Attributes
    ----------
    facts : blocks of plain numbers for the tracker, as the rig gave them.
    casts : the finished casts in the order of their numbers.
    """

    folder: Path
    rig: str
    cable: Cable
    r0_m: float
    facts: dict[str, Any] = field(default_factory=dict)
    casts: tuple[CastRequest, ...] = ()

    def cast_folder(self, cast: CastRequest) -> Path:
        """Return where the files of a finished cast lie."""
        return self.folder / cast.folder_name


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
        write_text(path, yaml.safe_dump(values, sort_keys=False))
    elif (stands := _load(path)) != values:
        changed = sorted(
            CHANGED.get(k, k) for k in {*stands, *values} if stands.get(k) != values.get(k)
        )
        raise ValueError(
            f"{folder}: this session was begun with another {' and another '.join(changed)}; "
            "a session is never rewritten: move it away or collect elsewhere (paths.sessions=…)"
        )
    return read_session(folder)


def read_session(folder: Path) -> Session:
    """Read a session folder."""
    path = folder / SESSION_FILE
    if not path.is_file():
        raise ValueError(f"{folder}: no {SESSION_FILE}; not a session, collect writes one")
    values = _load(path)
    casts = [read_request(entry) for entry in sorted(folder.glob("cast_*")) if entry.is_dir()]
    return Session(
        folder=folder,
        rig=values.pop("rig"),
        cable=Cable(**values.pop("cable")),
        r0_m=float(values.pop("r0_m")),
        facts=values,
        casts=tuple(casts),
    )


def read_request(folder: Path) -> CastRequest:
    """Read what was asked for in a finished cast's folder."""
    values = _load(folder / REQUEST_FILE)
    action = Action(*(float(values["action"][name]) for name in ACTION_COLUMNS))
    return CastRequest(int(values["number"]), int(values["action_id"]), action)


def write_request(request: CastRequest, folder: Path) -> None:
    """Write what was asked for into a cast's folder."""
    numbers = zip(ACTION_COLUMNS, request.action.as_array().tolist(), strict=True)
    values = {"number": request.number, "action_id": request.action_id, "action": dict(numbers)}
    write_text(folder / REQUEST_FILE, yaml.safe_dump(values, sort_keys=False))


def missing_requests(session: Session, requests: Sequence[CastRequest]) -> list[CastRequest]:
    """Return the requests that are not finished; refuse a number that holds another action."""
    finished = {cast.number: cast for cast in session.casts}
    missing = []
    for request in requests:
        cast = finished.get(request.number)
        if cast is None:
            missing.append(request)
        elif not np.allclose(cast.action.as_array(), request.action.as_array(), atol=1e-9):
            raise ValueError(
                f"{session.cast_folder(cast)}: holds another action than the one asked for under "
                f"this number ({_say(cast.action)} instead of {_say(request.action)}); "
                "a finished cast is never replaced: move the session away or collect elsewhere "
                "(paths.sessions=…)"
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


def _load(path: Path) -> dict[str, Any]:
    return yaml.safe_load(path.read_text(encoding="utf-8"))


def _say(action: Action) -> str:
    return ", ".join(f"{value:.4g}" for value in action.as_array())
