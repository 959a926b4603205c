"""Work done in processes, one a core, because what Python does between steps needs a core too.

It is batches of casts and the training of small networks. On two threads the interpreter runs one
of them at a time: small batches were no faster than on one. The processes start with the first
work worth sending, stay, and end with this one.
"""

import os
import pickle
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from typing import Any, TypeVar

from robotcast.processes.workers import Workers

PATIENCE_S = 3600.0  # a batch of casts takes seconds, a network minutes

Part = TypeVar("Part")
Answer = TypeVar("Answer")


class _Own(threading.local):
    """The process that answers a thread of the pool."""

    def __init__(self) -> None:
        self.workers = Workers("robotcast.processes.elsewhere:prepare", None, 1, PATIENCE_S)


class _Calls:
    """How many calls share the processes at the moment."""

    def __init__(self) -> None:
        self._lock, self._now = threading.Lock(), 0

    @contextmanager
    def one_more(self) -> Iterator[int]:
        """Count a call in; yield how many there are with it."""
        with self._lock:
            self._now += 1
            now = self._now
        try:
            yield now
        finally:
            with self._lock:
                self._now -= 1


_own, _calls = _Own(), _Calls()


def cores(threads: int) -> int:
    """Return how many cores work takes that is told `threads`, 0 for all."""
    return threads or len(os.sched_getaffinity(0))


@contextmanager
def shared(threads: int) -> Iterator[int]:
    """Yield into how many parts a call should cut its work: fewer beside other calls."""
    with _calls.one_more() as calls:
        yield max(1, threads // calls)


def answers(
    work: Callable[[Part], Answer], parts: Sequence[Part], threads: int
) -> Iterator[Answer]:
    """Yield what `work` answers to every part, in order, from as many processes as `threads`.

    On one thread the work is done here. `work` and the parts must pickle; what a process cannot
    import or fails at is done here as well, so that an error is raised where its cause is.
    """
    if threads == 1:
        yield from map(work, parts)
    else:
        yield from _pool(threads).map(lambda part: _answer(work, part), parts)


def prepare(_: None) -> Callable[[bytes], tuple[bool, Any]]:
    """Return what a process does with one part: whether it could, and the answer."""

    def answer(sent: bytes) -> tuple[bool, Any]:
        try:
            work, part = pickle.loads(sent)
            return True, work(part)
        except Exception:
            return False, None

    return answer


def _answer(work: Callable[[Part], Answer], part: Part) -> Answer:
    try:
        sent = pickle.dumps((work, part), protocol=pickle.HIGHEST_PROTOCOL)
    except (pickle.PicklingError, AttributeError, TypeError):
        return work(part)
    ((could, answer),) = _own.workers.answer([sent])
    return answer if could else work(part)


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads)
