"""Worker processes that stay, each with its own memory, for work that needs one apiece.

A worker is this interpreter running `worker_main`. It and its parent talk over a socket pair,
since libraries write to standard output. A second pipe, the lifeline, carries nothing: when the
parent ends, however it ends, the kernel closes it and kills the worker, whatever it is doing.
"""

import os
import subprocess
import sys
import time
import weakref
from collections.abc import Sequence
from dataclasses import dataclass, field
from multiprocessing import Pipe
from multiprocessing.connection import Connection, wait
from typing import Any

from robotcast.progress import Progress, silent

MAIN = "robotcast.processes.worker_main"


@dataclass
class _Worker:
    process: subprocess.Popen[bytes]
    talk: Connection
    lifeline: int
    task: int | None = None  # the number of the task it is at, None when idle
    since: float = field(default_factory=time.monotonic)

    def end(self) -> None:
        """Kill the process and wait for it."""
        self.process.kill()
        self.process.wait()
        self.talk.close()
        os.close(self.lifeline)


class Workers:
    """Processes that answer tasks; what they answer does not depend on how many there are.

    Parameters
    ----------
    prepare : "module:function" that a worker calls with `setup`, once; it returns what answers
        one task. The module, and the classes of all that is sent, must be importable.
    n : number of processes. They start with the first tasks.
    patience_s : how long a task may take; a worker that takes longer hangs.
    """

    def __init__(self, prepare: str, setup: Any, n: int, patience_s: float) -> None:
        self._prepare, self._setup, self._n = prepare, setup, n
        self._patience_s = patience_s
        self._workers: list[_Worker] = []
        self._finalizer = weakref.finalize(self, _end, self._workers)

    @property
    def pids(self) -> list[int]:
        """The processes that are running."""
        return [worker.process.pid for worker in self._workers]

    def answer(self, tasks: Sequence[Any], progress: Progress = silent) -> list[Any]:
        """Return the workers' answers to all tasks, in the order of the tasks.

        Raises
        ------
        RuntimeError : a worker died, hangs or raised; the workers are ended then.
        """
        try:
            while len(self._workers) < min(self._n, len(tasks)):
                self._workers.append(_start(self._prepare, self._setup))
            return self._answer(tasks, progress)
        except BaseException:  # a keyboard interrupt too would leave answers on the way
            _end(self._workers)
            raise

    def _answer(self, tasks: Sequence[Any], progress: Progress) -> list[Any]:
        answers: list[Any] = [None] * len(tasks)
        begun = done = 0
        while done < len(tasks):
            for worker in self._workers:
                if worker.task is None and begun < len(tasks):
                    _tell(worker, tasks[begun])
                    worker.task, worker.since = begun, time.monotonic()
                    begun += 1
            busy = {worker.talk: worker for worker in self._workers if worker.task is not None}
            longest = max(time.monotonic() - worker.since for worker in busy.values())
            ready = wait(list(busy), max(0.0, self._patience_s - longest))
            if not ready:
                raise RuntimeError(
                    f"a worker process has not answered for {self._patience_s:g} s and was "
                    "ended; a larger patience_s gives it longer"
                )
            for talk in ready:
                worker = busy[talk]  # type: ignore[index]
                answers[worker.task] = _hear(worker)  # type: ignore[index]
                worker.task = None
                done += 1
            progress(done, len(tasks))
        return answers


def _start(prepare: str, setup: Any) -> _Worker:
    """Start a worker; the far ends of its socket and of its lifeline are its own alone."""
    here, there = Pipe()
    held_by_worker, held_here = os.pipe()
    handed = (there.fileno(), held_by_worker)
    try:
        process = subprocess.Popen(
            [sys.executable, "-m", MAIN, *map(str, handed), prepare],
            pass_fds=handed,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        )
    finally:
        there.close()
        os.close(held_by_worker)
    worker = _Worker(process, here, held_here)
    _tell(worker, setup)
    return worker


def _tell(worker: _Worker, message: Any) -> None:
    try:
        worker.talk.send(message)
    except ConnectionError:
        raise _death(worker) from None


def _hear(worker: _Worker) -> Any:
    try:
        failure, answer = worker.talk.recv()
    except (EOFError, ConnectionError):
        raise _death(worker) from None
    if failure:
        raise RuntimeError(f"a worker process failed: {failure}")
    return answer


def _death(worker: _Worker) -> RuntimeError:
    code = worker.process.wait()
    how = f"was killed by signal {-code}" if code < 0 else f"ended with exit status {code}"
    return RuntimeError(f"a worker process {how} before it answered")


def _end(workers: list[_Worker]) -> None:
    while workers:
        workers.pop().end()
