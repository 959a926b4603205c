"""A worker's work for tests of the processes: it counts, sleeps, dies or raises as told."""

import ctypes
import os
import signal
import time
from collections.abc import Callable


def prepare(start: int) -> Callable[[tuple[str, int]], int]:
    def answer(task: tuple[str, int]) -> int:
        kind, number = task
        if kind == "die":
            os.kill(os.getpid(), signal.SIGKILL)
        if kind == "raise":
            raise ValueError(f"no {number}")
        if kind == "sleep":
            time.sleep(number)
        if kind == "freeze":  # a library's call that lets no other thread of Python run
            ctypes.PyDLL(None).sleep(number)
        return start + number

    return answer


def refuse(start: int) -> None:
    raise ValueError(f"cannot start from {start}")
