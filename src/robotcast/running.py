"""What a command says of itself while it runs: one small file, which `robotcast watch` reads."""

import json
import os
import time
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Protocol

from robotcast.files import write_text


class Progress(Protocol):
    """Called with the units done so far, the total, and a few words on the state."""

    def __call__(self, done: int, total: int, note: str = "") -> None: ...


def silent(done: int, total: int, note: str = "") -> None:
    """Report nothing."""


KEPT = 200  # files of commands, the last ones
EVERY_S = 0.5  # a bar is written no more often


@dataclass
class Run:
    """A command while it runs, and after; times are Unix times [s]."""

    stage: str
    overrides: list[str]
    pid: int
    started_s: float
    updated_s: float = 0.0
    status: int | None = None  # as a shell has it, None before the end
    title: str = ""  # of the bar that was shown last, as are those that follow
    done: int = 0
    total: int = 0
    note: str = ""
    begun_s: float = 0.0
    page: str = ""  # the HTML file that shows what came of it so far, "" for none

    @property
    def runs(self) -> bool:
        return self.status is None and alive(self.pid)

    @property
    def left_s(self) -> float | None:
        """How long its bar still takes at the speed so far, None while nobody knows."""
        if not 0 < self.done <= self.total:
            return None
        speed_per_s = self.done / max(self.updated_s - self.begun_s, 1e-3)
        return max(0.0, (self.total - self.done) / speed_per_s - (time.time() - self.updated_s))


def alive(pid: int) -> bool:
    """Tell whether there is such a process on this machine."""
    try:
        os.kill(pid, 0)
    except PermissionError:
        return True
    except ProcessLookupError:
        return False
    return True


def read_runs(folder: Path) -> list[Run]:
    """Return the commands that left a file in `folder`, the last one first."""
    runs = []
    for path in folder.glob("*.json"):
        with suppress(FileNotFoundError, TypeError, ValueError):  # gone, or of another version
            runs.append(Run(**json.loads(path.read_text(encoding="utf-8"))))
    return sorted(runs, key=lambda run: -run.started_s)


_current: tuple[Path, Run] | None = None


@contextmanager
def followed(folder: Path, stage: str, overrides: Sequence[str]) -> Iterator[None]:
    """Keep a file in `folder` on what runs inside; the same command replaces its file."""
    global _current
    key = zlib.crc32(json.dumps(list(overrides)).encode())
    before, run = _current, Run(stage, list(overrides), os.getpid(), time.time())
    _current = folder / f"{stage}-{key:08x}.json", run
    with suppress(OSError):  # another command forgets them too
        for old in sorted(folder.glob("*.json"), key=os.path.getmtime)[:-KEPT]:
            old.unlink()
    say(status=None)
    status = 1
    try:
        yield
        status = 0
    finally:
        say(status=status)
        _current = before


def say(now: bool = True, **facts: Any) -> None:
    """Note facts of the command that runs; write them now, or when the last time is long ago."""
    if _current is None:
        return
    path, run = _current
    vars(run).update(facts)
    if now or time.time() - run.updated_s >= EVERY_S:
        run.updated_s = time.time()
        with suppress(OSError):  # a run must not fail because nobody can follow it
            write_text(path, json.dumps(asdict(run), ensure_ascii=False))


def write_page(path: Path, page: str) -> None:
    """Write the HTML page that shows what came of the command so far."""
    write_text(path, page)
    say(page=str(path.resolve()))
