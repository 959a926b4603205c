"""A pool of processes for one piece of work, which ends with that work, however it ends."""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import parent_process
from multiprocessing.connection import wait
from multiprocessing.context import SpawnContext, SpawnProcess


@contextmanager
def process_pool(workers: int, begin: Callable[[], object] | None = None) -> Iterator[Executor]:
    """Yield a pool that drops what is queued once its user stops, and finishes what is under way.

    A terminal's interrupt reaches the user of the pool alone, who decides. A generator that holds
    the pool must be closed by who reads it (`contextlib.closing`): an interrupt elsewhere leaves
    it suspended, and the interpreter then waits for everything queued.

    Parameters
    ----------
    begin : called in each process before its first work. Like all work it must be something that
        pickle can send, of a module and not of the main script, which the processes do not import.
    """
    pool = ProcessPoolExecutor(workers, _LightContext(), _begin, (begin,))
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)


class _LightProcess(SpawnProcess):
    """A process that does not import the main script: a stage's imports take seconds."""

    def start(self) -> None:
        main = vars(sys.modules["__main__"])
        path = main.pop("__file__", None)  # where a spawned process would import it from
        try:
            super().start()
        finally:
            if path is not None:
                main["__file__"] = path


class _LightContext(SpawnContext):
    Process = _LightProcess


def _begin(begin: Callable[[], object] | None) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if begin is not None:
        begin()


def _end_with_parent() -> None:
    # One that was killed with -9 must not leave workers that write into its successor's files.
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
