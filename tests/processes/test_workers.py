"""What worker processes promise: the same answers, no hang, nothing left behind."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from robotcast.processes.workers import Workers

ROOT = Path(__file__).resolve().parents[2]
TOY = "tests.processes.toy_worker:prepare"


def alive(pid: int) -> bool:
    """Tell whether a process runs; one that has ended and is not yet reaped does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def gone_within(seconds: float, pids: list[int]) -> bool:
    until = time.monotonic() + seconds
    while any(alive(pid) for pid in pids) and time.monotonic() < until:
        time.sleep(0.02)
    return not any(alive(pid) for pid in pids)


def test_answers_come_in_the_order_of_the_tasks_whatever_the_number_of_processes() -> None:
    tasks = [("add", number) for number in range(20)]
    for n in (1, 3):
        assert Workers(TOY, 100, n, 60.0).answer(tasks) == list(range(100, 120))


def test_processes_stay_for_the_next_tasks_and_end_with_their_owner() -> None:
    workers = Workers(TOY, 0, 2, 60.0)
    workers.answer([("add", 1)] * 4)
    pids = workers.pids
    workers.answer([("add", 2)] * 4)
    assert workers.pids == pids
    del workers
    assert gone_within(5.0, pids)


def test_they_outlive_the_thread_that_started_them() -> None:
    workers = Workers(TOY, 0, 1, 60.0)
    thread = threading.Thread(target=workers.answer, args=([("add", 1)],))
    thread.start()
    thread.join()
    pids = workers.pids
    assert workers.answer([("add", 5)]) == [5]
    assert workers.pids == pids


@pytest.mark.parametrize(
    ("prepare", "kind", "message"),
    [
        (TOY, "die", "was killed by signal 9 before it answered"),
        (TOY, "raise", "failed: ValueError: no 30"),
        (TOY, "sleep", "has not answered for 8 s"),
        (TOY, "freeze", "has not answered for 8 s"),
        (TOY.replace("prepare", "refuse"), "add", "failed: ValueError: cannot start from 0"),
    ],
)
def test_a_worker_that_fails_is_said_and_none_is_left(
    prepare: str, kind: str, message: str
) -> None:
    workers = Workers(prepare, 0, 2, 8.0 if "8 s" in message else 60.0)
    if prepare == TOY:
        workers.answer([("add", 1)] * 2)
    pids = workers.pids
    with pytest.raises(RuntimeError, match=message):
        workers.answer([("add", 1), (kind, 30), ("add", 2)])
    assert gone_within(5.0, pids)
    if prepare == TOY:
        assert workers.answer([("add", 3)]) == [3]


@pytest.mark.parametrize("kind", ["sleep", "freeze"])
def test_nothing_is_left_behind_when_the_parent_is_killed(kind: str, tmp_path: Path) -> None:
    """SIGKILL, which lets the parent clean up nothing, while its workers are at work."""
    told = tmp_path / "pids"
    script = (
        "import pathlib, threading, time\n"
        "from robotcast.processes.workers import Workers\n"
        f"workers = Workers({TOY!r}, 0, 2, 600.0)\n"
        "workers.answer([('add', 1)] * 2)\n"
        f"threading.Thread(target=workers.answer, args=([({kind!r}, 300)] * 2,)).start()\n"
        "time.sleep(0.5)\n"
        f"pathlib.Path({str(told)!r}).write_text(' '.join(map(str, workers.pids)))\n"
    )
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    parent = subprocess.Popen([sys.executable, "-c", script], cwd=ROOT, env=environment)
    while not (told.exists() and len(told.read_text().split()) == 2):
        assert parent.poll() is None, "the parent ended by itself"
        time.sleep(0.02)
    pids = [int(pid) for pid in told.read_text().split()]
    assert all(alive(pid) for pid in pids)
    parent.send_signal(signal.SIGKILL)
    parent.wait()
    assert gone_within(5.0, pids)
