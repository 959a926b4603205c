"""The live page of what runs here, and where the pipeline of dvc.yaml stands.

It only reads what stages and DVC write, without DVC's locks, and disturbs no run.
"""

import asyncio
import base64
import html
import json
import os
import re
import shlex
import statistics
import time
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import cv2
import numpy as np
from aiohttp import web
from dvc.exceptions import DvcException

from robotcast.reporting.page import render
from robotcast.running import Run, alive, read_runs
from robotcast.sessions import VIDEO_FILE

Key = tuple[str, ...]


@dataclass(frozen=True)
class Cell:
    """One stage of the pipeline, as `dvc repro NAME` takes it."""

    name: str
    needs: tuple[str, ...]  # cells whose outputs it reads
    key: Key  # its command
    outputs: tuple[str, ...]  # paths
    state: str  # "done" where lock, files and all it needs agree; "running", "failed" or "left"
    left_s: float | None = 0.0  # how long it still takes, None where nothing like it has run

    @property
    def stage(self) -> str:
        return self.name.split("@")[0]


def pipeline(root: Path, runs: Sequence[Run]) -> list[Cell]:
    """Return the cells of dvc.yaml, each after those it needs; `runs`: the last ones first."""
    if not (root / "dvc.yaml").is_file():
        return []
    last = {_key(run.stage, run.overrides): run for run in reversed(runs)}
    took_s: dict[Key | str, list[float]] = defaultdict(list)
    for key, run in last.items():
        if run.status == 0:
            took_s[key].append(run.updated_s - run.started_s)
            took_s[run.stage].append(run.updated_s - run.started_s)
    locked, found = _being_written(root), dict[str, Cell]()
    for cell in _cells(root, _stamp(root)):
        run, state = last.get(cell.key), cell.state
        if (run and run.runs) or locked & set(cell.outputs):
            state = "running"
        elif state == "left" or any(found[name].state != "done" for name in cell.needs):
            state = "failed" if run and run.status != 0 else "left"
        known_s = took_s.get(cell.key) or took_s.get(cell.key[0])
        left_s = statistics.median(known_s) if known_s else None
        if state == "running" and run:
            spent_s = time.time() - run.started_s
            left_s = run.left_s if left_s is None else max(0.0, left_s - spent_s)
        found[cell.name] = replace(cell, state=state, left_s=0.0 if state == "done" else left_s)
    return list(found.values())


def _key(stage: str, overrides: Sequence[str]) -> Key:
    """Name a command, whatever the order of its overrides."""
    return (stage, *sorted(overrides))


def _being_written(root: Path) -> set[str]:
    """Return the outputs of stages that DVC runs now."""
    with suppress(FileNotFoundError, json.JSONDecodeError):  # it is being rewritten
        locks = json.loads((root / ".dvc/tmp/rwlock").read_text(encoding="utf-8"))
        return {path for path, by in locks.get("write", {}).items() if alive(by["pid"])}
    return set()


def _stamp(root: Path) -> tuple[int, ...]:
    """Return what differs once a file has changed that decides which cells stand."""
    code = [p for folder in ("src", "stages", "conf") for p in (root / folder).rglob("*.*")]
    files = [*code, *(root / name for name in ("dvc.yaml", "dvc.lock", "params.yaml"))]
    times = [p.stat().st_mtime_ns for p in files if p.suffix != ".pyc" and p.exists()]
    return len(times), max(times)


@lru_cache(maxsize=1)
def _cells(root: Path, stamp: tuple[int, ...]) -> tuple[Cell, ...]:
    """Ask DVC for its stages; "done" are those whose own entry in dvc.lock holds."""
    from dvc.repo import Repo  # takes a second
    from dvc_data.hashfile.state import StateNoop

    repo = Repo(str(root))
    repo.state = StateNoop()  # remembers nothing, so that it writes nothing
    stages = repo.stage.load_all(str(root.resolve() / "dvc.yaml"))
    made = {out.fs_path: (out, stage) for stage in stages for out in stage.outs}
    found: dict[str, Cell] = {}

    @cache
    def makers(path: str) -> list[Any]:
        return [stage for out, (_, stage) in made.items() if _overlap(path, out)]

    @cache
    def current(path: str) -> Any:
        known = (d for s in stages for d in s.deps if not hasattr(d, "params"))
        return next(dep for dep in known if dep.fs_path == path).get_hash()

    def holds(dep: Any) -> bool:
        with suppress(FileNotFoundError):
            if hasattr(dep, "params"):
                return not dep.status()
            if dep.fs_path in made:
                return dep.hash_info == made[dep.fs_path][0].hash_info
            return bool(makers(dep.fs_path)) or dep.hash_info == current(dep.fs_path)
        return False

    def visit(stage: Any) -> None:
        if stage.name in found:
            return
        needed = {s.name: s for dep in stage.deps for s in makers(dep.fs_path)}
        for other in needed.values():
            visit(other)
        outputs = tuple(out.fs_path for out in stage.outs)
        _, script, *overrides = shlex.split(stage.cmd)
        stands = not stage.cmd_changed and all(map(os.path.exists, outputs))
        state = "done" if stands and all(map(holds, stage.deps)) else "left"
        key = _key(Path(script).stem, overrides)
        found[stage.name] = Cell(stage.name, tuple(needed), key, outputs, state)

    for stage in stages:
        visit(stage)
    return tuple(found.values())


def _overlap(one: str, other: str) -> bool:
    return (one + os.sep).startswith(other + os.sep) or (other + os.sep).startswith(one + os.sep)


HOST, OURS = "127.0.0.1", ("127.0.0.1", "localhost")
FOLDERS = ("data/", "outputs/", "reports/")  # all that the page shows and links to
PAGES = ("index.html", "revisions.html")
SCAN_S = 3  # how often the folders are looked through
FILMED, INSTANTS, WIDE = 3, 6, 480  # pictures, moments in each, pixels
BOX, GAP, ROW = 128, 30, 66  # of the drawn pipeline, pixels


def serve(root: Path, runs: Path, port: int) -> None:
    """Serve the page of what runs in `root`, to this machine alone, until it is interrupted.

    Commands say in `runs` how far they are.
    """
    rendering, shown = asyncio.Lock(), ""

    async def page(_: web.Request) -> web.Response:
        nonlocal shown
        async with rendering:
            try:
                shown = await asyncio.to_thread(watch_page, root, runs)
            except (OSError, DvcException):  # a file is being replaced: the page stays for now
                if not shown:
                    raise
        return web.Response(text=shown, content_type="text/html")

    async def file(request: web.Request) -> web.FileResponse:
        path = os.path.normpath(request.path.lstrip("/"))  # a link of DVC's leads to its cache
        if not path.startswith(FOLDERS) or not (root / path).is_file():
            raise web.HTTPNotFound
        return web.FileResponse(root / path, headers={"Cache-Control": "no-cache"})

    @web.middleware
    async def ours(request: web.Request, handler):
        """Refuse pages of others that the browser was told lie here."""
        if request.host.rpartition(":")[0] not in OURS:
            raise web.HTTPForbidden
        return await handler(request)

    app = web.Application(middlewares=[ours])
    app.add_routes([web.get("/", page), web.get("/{path:.+}", file)])
    web.run_app(app, host=HOST, port=port, print=None, access_log=None)


def watch_page(root: Path, runs: Path) -> str:
    """Return the page as it is now."""
    known = [run for run in read_runs(runs) if run.stage != "watch"]
    cells, active = pipeline(root, known), [run for run in known if run.runs]
    left = [cell.left_s for cell in cells if cell.state != "done"]
    at_once = max(1, sum(cell.state == "running" for cell in cells))
    moment = int(time.time() / SCAN_S)
    results, films = _results(root, moment), _films(root, moment)
    shown = [_link(root, run.page) for run in active if run.page]
    return render(
        "watch.html",
        place=root.resolve().name,
        cells=cells,
        drawing=_drawing(cells),
        left_s=sum(s for s in left if s is not None) / at_once,
        unknown=sum(s is None for s in left),
        active=active,
        last=next((run for run in known if not run.runs), None),
        shown=[link for link in shown if link] or [r.link for r in results[:1]],
        results=results,
        films=[(path.parent, _picture(path)) for path in films],
        time=_time,
        ago=lambda then_s: _time(time.time() - then_s),
    )


class Result(NamedTuple):
    """A page that a stage wrote: when, its place below the root, its title."""

    written_s: float
    link: str
    title: str


@lru_cache(maxsize=1)
def _results(root: Path, moment: int) -> list[Result]:
    """Return the pages there are, the last one first."""
    found = [
        Result(path.stat().st_mtime, path.relative_to(root).as_posix(), _title(path))
        for path in _files(root, PAGES)
    ]
    return sorted(found, key=lambda result: -result.written_s)


@lru_cache(maxsize=1)
def _films(root: Path, moment: int) -> list[Path]:
    """Return the videos that were finished last."""
    return sorted(_files(root, (VIDEO_FILE,)), key=os.path.getmtime)[: -FILMED - 1 : -1]


def _files(root: Path, names: Sequence[str]) -> Iterator[Path]:
    for folder in FOLDERS:
        for place, folders, files in os.walk(root / folder):
            folders[:] = [name for name in folders if not name.startswith(".")]
            yield from (Path(place) / name for name in names if name in files)


def _title(path: Path) -> str:
    with path.open(encoding="utf-8") as page:
        found = re.search(r"<title>(.*?)</title>", page.read(4000), re.S)
    return html.unescape(found[1]) if found else path.parent.name


def _link(root: Path, page: str) -> str | None:
    """Return where the page lies below the root, None where it is not shown."""
    link = os.path.relpath(page, root.resolve())
    return link if link.startswith(FOLDERS) else None


@lru_cache(maxsize=4 * FILMED)
def _picture(video: Path) -> str:
    """Return what moved in a video, at several moments, in one picture: a data URI."""
    film = cv2.VideoCapture(str(video))
    count, picture, moved = int(film.get(cv2.CAP_PROP_FRAME_COUNT)), None, None
    for number in range(INSTANTS):
        film.set(cv2.CAP_PROP_POS_FRAMES, number * (count - 1) // (INSTANTS - 1))
        read, frame = film.read()
        if not read:
            continue
        frame = cv2.resize(frame, (WIDE, WIDE * frame.shape[0] // frame.shape[1]))
        if picture is None or moved is None:
            first, picture, moved = frame, frame, frame.max(axis=2) * 0
        change = cv2.absdiff(frame, first).max(axis=2)
        picture = np.where((change > moved)[..., None], frame, picture)
        moved = np.maximum(change, moved)
    film.release()
    if picture is None:
        return ""
    coded = cv2.imencode(".jpg", picture)[1].tobytes()
    return f"data:image/jpeg;base64,{base64.b64encode(coded).decode()}"


class Box(NamedTuple):
    """All cells of one name, where they are drawn [pixels]."""

    name: str
    cells: list[Cell]
    x: int
    y: int


def _drawing(cells: Sequence[Cell]) -> SimpleNamespace:
    """Place the stages in columns, each to the right of all that it needs, with arrows between."""
    stage_of = {cell.name: cell.stage for cell in cells}
    groups: dict[str, list[Cell]] = defaultdict(list)
    direct: dict[str, set[str]] = defaultdict(set)
    for cell in cells:
        groups[cell.stage].append(cell)
        direct[cell.stage] |= {stage_of[name] for name in cell.needs} - {cell.stage}
    above: dict[str, set[str]] = {}  # all that a stage needs, at whatever distance
    boxes: dict[str, Box] = {}
    rows = Counter[int]()  # in each column
    for stage, members in groups.items():
        above[stage] = direct[stage].union(*(above.get(need, ()) for need in direct[stage]))
        placed = [boxes[need] for need in direct[stage] if need in boxes]
        x = max((box.x + BOX + GAP for box in placed), default=0)
        boxes[stage] = Box(stage, members, x, rows[x] * ROW)
        rows[x] += 1
    arrows = [
        (boxes[need], boxes[stage])
        for stage in groups
        for need in direct[stage]
        if not any(need in above[other] for other in direct[stage])
    ]
    size = max(1, len(rows)) * (BOX + GAP) - GAP, max(rows.values(), default=0) * ROW
    return SimpleNamespace(boxes=boxes.values(), arrows=arrows, size=size, box=BOX, gap=GAP)


def _time(seconds: float) -> str:
    """Return a length of time in few letters: 40 s, 12 min, 3 h."""
    for unit_s, unit in ((86400, "days"), (3600, "h"), (60, "min")):
        if seconds >= 2 * unit_s:
            return f"{seconds / unit_s:.0f} {unit}"
    return f"{max(0.0, seconds):.0f} s"
