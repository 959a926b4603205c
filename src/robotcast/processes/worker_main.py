"""A worker process: prepares once, then answers one task after the other (see `workers`)."""

import fcntl
import os
import signal
import sys
from importlib import import_module
from multiprocessing.connection import Connection
from typing import Any


def die_with(lifeline: int) -> None:
    """Have the kernel kill this process when the other end of a pipe is closed.

    Not by the parent-death signal: that one comes when the thread ends that started the
    worker. Not by a thread that watches the pipe: a library's call may keep it from running.
    """
    fcntl.fcntl(lifeline, fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(lifeline, fcntl.F_SETSIG, signal.SIGKILL)
    flags = fcntl.fcntl(lifeline, fcntl.F_GETFL)
    fcntl.fcntl(lifeline, fcntl.F_SETFL, flags | os.O_ASYNC | os.O_NONBLOCK)
    try:
        closed_already = os.read(lifeline, 1) == b""
    except BlockingIOError:
        return
    if closed_already:
        sys.exit()


def serve(talk: Connection, prepare: str) -> None:
    """Answer tasks until the parent hangs up: (what went wrong or "", the answer)."""
    module, function = prepare.split(":")
    answer, failure = None, ""
    try:
        answer = getattr(import_module(module), function)(talk.recv())
    except EOFError:
        return
    except Exception as wrong:
        failure = _sentence(wrong)
    while True:
        try:
            task = talk.recv()
        except (EOFError, ConnectionError):
            return
        talk.send(_attempt(answer, task) if answer else (failure, None))


def _attempt(answer: Any, task: Any) -> tuple[str, Any]:
    try:
        return "", answer(task)
    except Exception as wrong:
        return _sentence(wrong), None


def _sentence(wrong: Exception) -> str:
    return f"{type(wrong).__name__}: {wrong}"


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides what an interrupt ends
    die_with(int(sys.argv[2]))
    serve(Connection(int(sys.argv[1])), sys.argv[3])
