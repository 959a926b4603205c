"""Where the pipeline of dvc.yaml stands: read from its files, without DVC's locks."""

import json
import os
import shlex
import statistics
import time
from collections import defaultdict
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from robotcast.running import Run, alive

Key = tuple[str, ...]


@dataclass(frozen=True)
class Cell:
    """One stage of the pipeline, as `dvc repro NAME` takes it.

    Attributes
    ----------
    needs : names of the cells whose outputs it reads.
    key : its command, `_key`.
    outputs : their paths.
    state : "done" only where dvc.lock, files and all that it needs agree.
    left_s : how long it still takes, None where nothing like it has run here.
    """

    name: str
    needs: tuple[str, ...]
    key: Key
    outputs: tuple[str, ...]
    state: str  # "done", "running", "failed" or "left"
    left_s: float | None = 0.0

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
        return next(d for s in stages for d in s.deps if d.fs_path == path).get_hash()

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
