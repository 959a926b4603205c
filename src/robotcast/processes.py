"""Work on all cores, in processes that end with the one that started them, however it ends.

Processes and not threads, because what Python does between two steps needs a core too. What comes
back does not depend on how many there are. All that is sent must be something that pickle can
send, of a module and not of the main script, which the processes do not import.
"""

import fcntl
import multiprocessing.connection
import multiprocessing.context
import os
import pickle
import signal
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnContext, SpawnProcess
from multiprocessing.util import Finalize
from typing import Any, TypeVar

PATIENCE_S = 3600.0  # a batch of casts takes seconds, a network minutes
AHEAD = 4  # parts for every process that are sent before the first of them is done

Part = TypeVar("Part")
Answer = TypeVar("Answer")


def cores(threads: int) -> int:
    """Return on how many cores to work where `threads` are asked for, 0 for all."""
    return threads or len(os.sched_getaffinity(0))


@contextmanager
def process_pool(workers: int, begin: Callable[[], object] | None = None) -> Iterator[Executor]:
    """Yield a pool that drops what is queued once its user stops, and finishes what is under way.

    One worker is this process, whose `map` works as it is read; of more each calls `begin` before
    its first work. A terminal's interrupt reaches the user of the pool alone, who decides.
    """
    if workers <= 1:
        yield _Here()
        return
    pool = ProcessPoolExecutor(workers, _Context(), _begin, (begin,))
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)


class _Here(Executor):
    def map(self, fn: Callable[..., Any], *parts: Iterable[Any], **_: Any) -> Iterator[Any]:
        return map(fn, *parts)


def parallel_map(
    work: Callable[[Part], Answer],
    parts: Iterable[Part],
    workers: int,
    patience_s: float = PATIENCE_S,
) -> Iterator[Answer]:
    """Yield what `work` returns for every part, in order, from processes that stay for the next.

    One worker is this process. What a process cannot import or fails at is done here as well, so
    that an error is raised where its cause is.

    Raises RuntimeError where a process was killed, or took longer than `patience_s` over one part;
    all are ended then, and start anew with the next call.
    """
    if workers == 1:
        yield from map(work, parts)
        return
    sent: deque[tuple[Part, Future[tuple[bool, Any]] | None]] = deque()

    def received() -> Answer:
        part, future = sent.popleft()
        if future:
            with _ended_on_failure(workers, patience_s):
                could, answer = future.result(patience_s)
            if could:
                return answer
        return work(part)

    try:
        for part in parts:
            sent.append((part, _send(work, part, workers, patience_s)))
            if len(sent) >= AHEAD * workers:
                yield received()
        while sent:
            yield received()
    finally:
        for _, future in sent:
            if future:
                future.cancel()


def helper_process(work: Callable[[Connection], object]) -> tuple[SpawnProcess, Connection]:
    """Start a process that does `work` at one end of a connection; return it and the other end.

    It ends quietly when the other end is closed, and with the process that started it.
    """
    context = _Context()
    ours, theirs = context.Pipe()
    process = context.Process(target=_help, args=(work, theirs), daemon=True)
    process.start()
    theirs.close()
    return process, ours


def _help(work: Callable[[Connection], object], orders: Connection) -> None:
    _begin(None)
    with suppress(EOFError, BrokenPipeError, ConnectionResetError):
        work(orders)


class _Process(SpawnProcess):
    """A process that does not import the main script: a stage's imports take seconds.

    Nor is it told how the one that starts it was started: in a job of a joblib sweep that is a way,
    loky, which Python alone does not know.
    """

    def start(self) -> None:
        main, context = vars(sys.modules["__main__"]), multiprocessing.context
        default = vars(context._default_context)  # pyright: ignore[reportAttributeAccessIssue]
        path = main.pop("__file__", None)  # where a spawned process would import it from
        how, default["_actual_context"] = default["_actual_context"], get_context("spawn")
        try:
            super().start()
        finally:
            default["_actual_context"] = how
            if path is not None:
                main["__file__"] = path


class _Context(SpawnContext):
    """Starts processes, and keeps them to be ended."""

    def __init__(self) -> None:
        self.started: list[_Process] = []

    def Process(self, *args: Any, **kwargs: Any) -> _Process:  # type: ignore[override]
        self.started.append(_Process(*args, **kwargs))
        return self.started[-1]


_staying: dict[int, tuple[ProcessPoolExecutor, _Context]] = {}  # by the number of workers


def _send(
    work: Callable[[Part], Answer], part: Part, workers: int, patience_s: float
) -> Future[tuple[bool, Any]] | None:
    """Send one part; None where pickle cannot."""
    try:
        sent = pickle.dumps((work, part), protocol=pickle.HIGHEST_PROTOCOL)
    except (pickle.PicklingError, AttributeError, TypeError):
        return None
    if workers not in _staying:
        context = _Context()
        pool = ProcessPoolExecutor(workers, context, _begin, (None,))
        _staying[workers] = pool, context
        # a job of a sweep waits for its children at its end: before their queues close, at 10
        Finalize(None, pool.shutdown, exitpriority=100)
    with _ended_on_failure(workers, patience_s):
        return _staying[workers][0].submit(_attempt, sent)


def _attempt(sent: bytes) -> tuple[bool, Any]:
    """Do what was sent; return whether that was possible, and what came of it."""
    try:
        work, part = pickle.loads(sent)
        return True, work(part)
    except Exception:
        return False, None


@contextmanager
def _ended_on_failure(workers: int, patience_s: float) -> Iterator[None]:
    """End the processes when one was killed or hangs; on an interrupt too, which must not wait."""
    try:
        yield
    except BaseException as wrong:
        pool, context = _staying.pop(workers)
        if not isinstance(wrong, BrokenProcessPool):
            for process in context.started:
                process.kill()
        pool.shutdown(cancel_futures=True)
        if isinstance(wrong, TimeoutError):
            raise RuntimeError(
                f"a worker process has not answered for {patience_s:g} s and was ended; a larger "
                "patience_s gives it longer"
            ) from None
        if isinstance(wrong, BrokenProcessPool):
            codes = [p.exitcode for p in context.started if p.exitcode != -signal.SIGTERM]
            code = next(filter(None, codes), -signal.SIGTERM)
            how = f"was killed by signal {-code}" if code < 0 else f"ended with exit status {code}"
            raise RuntimeError(f"a worker process {how} before it answered") from None
        raise


def _begin(begin: Callable[[], object] | None) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _die_with_parent()
    if begin is not None:
        begin()


def _die_with_parent() -> None:
    """Have the kernel kill this process when its parent ends, and with it the sentinel's pipe.

    One that was killed with -9 must not leave workers that write into its successor's files. Not
    by the parent-death signal: that one comes when the thread ends that started the process. Not
    by a thread that watches the pipe: a library's call may keep it from running.
    """
    pipe = parent_process().sentinel  # type: ignore[union-attr]
    fcntl.fcntl(pipe, fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(pipe, fcntl.F_SETSIG, signal.SIGKILL)
    fcntl.fcntl(pipe, fcntl.F_SETFL, fcntl.fcntl(pipe, fcntl.F_GETFL) | os.O_ASYNC)
    if multiprocessing.connection.wait([pipe], 0):
        os._exit(1)  # it has ended already
