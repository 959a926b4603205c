"""What worker processes promise: the same answers, no hang, nothing left behind."""

import ctypes
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import wait
from multiprocessing.connection import Connection
from pathlib import Path

import pytest

from robotcast.processes import helper_process, parallel_map, process_pool

ROOT = Path(__file__).resolve().parents[1]


def square(number: int) -> tuple[int, int]:
    return os.getpid(), number * number


def toy(task: tuple[str, int]) -> int:
    """Do what the task says: die, hang, raise, or return its number."""
    kind, number = task
    if kind == "die":
        os.kill(os.getpid(), signal.SIGKILL)
    if kind == "raise":
        raise ValueError(f"no {number} in {os.getpid()}")
    if kind == "sleep":
        time.sleep(number)
    if kind == "freeze":  # a library's call that lets no other thread of Python run
        ctypes.PyDLL(None).sleep(number)
    return number


def double(orders: Connection) -> None:
    while True:
        orders.send(2 * orders.recv())


def mark(task: tuple[str, str, int]) -> None:
    """Tell that the work has begun in a file of this process's number, then do it."""
    folder, kind, number = task
    (Path(folder) / str(os.getpid())).touch()
    toy((kind, number))


def note(folder: Path, number: int) -> None:
    time.sleep(0.1)
    (folder / str(number)).touch()


def pids(workers: int) -> set[int]:
    return {pid for pid, _ in parallel_map(square, range(8), workers)}


def alive(pid: int) -> bool:
    """Tell whether a process runs; one that has ended and is not yet reaped does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def gone_within(seconds: float, pids: set[int]) -> bool:
    until = time.monotonic() + seconds
    while any(alive(pid) for pid in pids) and time.monotonic() < until:
        time.sleep(0.02)
    return not any(alive(pid) for pid in pids)


def python(*command: str) -> subprocess.Popen[str]:
    """Start Python where it finds what this process does."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    return subprocess.Popen(
        [sys.executable, *command], cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True
    )


def test_one_worker_is_this_process_and_more_are_others() -> None:
    assert pids(1) == {os.getpid()}
    for n in (2, 3):
        assert len(pids(n)) <= n and os.getpid() not in pids(n)
        assert [x for _, x in parallel_map(square, range(30), n)] == [x * x for x in range(30)]


def of_job(number: int) -> list[tuple[int, int]]:
    return list(parallel_map(square, [number, number + 1], 2))


def test_a_job_of_a_joblib_sweep_may_have_processes_of_its_own() -> None:
    sweep = """
import joblib
from tests.test_processes import of_job
jobs = joblib.Parallel(n_jobs=2, backend="loky")(joblib.delayed(of_job)(n) for n in (3, 5))
print([[square for _, square in job] for job in jobs or ()])
"""
    said, _ = python("-c", sweep).communicate(timeout=120)
    assert said.strip() == "[[9, 16], [25, 36]]"


def test_processes_stay_for_the_next_work_and_outlive_the_thread_that_started_them() -> None:
    thread = threading.Thread(target=pids, args=(3,))
    thread.start()
    thread.join()
    assert len(pids(3) | pids(3)) <= 3


def test_an_error_is_raised_where_it_can_be_seen() -> None:
    with pytest.raises(ValueError, match=f"no 1 in {os.getpid()}"):
        list(parallel_map(toy, [("raise", 1)], 2))


def test_what_no_process_can_be_sent_is_done_here() -> None:
    def inner(number: int) -> tuple[int, int]:
        return square(number)

    assert list(parallel_map(inner, [3], 2)) == [(os.getpid(), 9)]


@pytest.mark.parametrize(
    ("kind", "message"),
    [("die", "was killed by signal 9 before it answered"), ("freeze", "has not answered for 3 s")],
)
def test_a_worker_that_fails_is_said_and_none_is_left(kind: str, message: str) -> None:
    before = pids(2)
    with pytest.raises(RuntimeError, match=message):
        list(parallel_map(toy, [("", 1), (kind, 30), ("", 2)], 2, 3.0))
    assert gone_within(5.0, before)
    assert list(parallel_map(toy, [("", 3)], 2)) == [3]


@pytest.mark.parametrize("kind", ["sleep", "freeze"])
def test_nothing_is_left_behind_when_the_parent_is_killed(kind: str, tmp_path: Path) -> None:
    """SIGKILL, which lets the parent clean up nothing, while its workers are at work."""
    parent = python(
        "-c",
        "from robotcast.processes import parallel_map; from tests.test_processes import mark\n"
        f"list(parallel_map(mark, [({str(tmp_path)!r}, {kind!r}, 300)] * 2, 2))",
    )
    while len(started := {int(path.name) for path in tmp_path.iterdir()}) < 2:
        assert parent.poll() is None, "the parent ended by itself"
        time.sleep(0.02)
    assert all(alive(pid) for pid in started)
    parent.kill()
    parent.wait()
    assert gone_within(5.0, started)


def test_an_interrupt_drops_what_is_queued_and_ends_what_is_under_way(tmp_path: Path) -> None:
    def interrupted() -> None:
        with process_pool(2) as pool:
            queued = [pool.submit(note, tmp_path, number) for number in range(60)]
            wait(queued[:1])
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert 1 <= len(list(tmp_path.iterdir())) < 12


def test_a_terminal_interrupts_the_one_who_opened_the_pool_alone() -> None:
    with process_pool(2) as pool:
        os.kill(pool.submit(os.getpid).result(), signal.SIGINT)
        assert pool.submit(pow, 2, 3).result() == 8


SAYS_WHEN_IMPORTED = """
import os
from robotcast.processes import process_pool
print("imported", flush=True)
if __name__ == "__main__":
    with process_pool(2) as pool:
        print(pool.submit(os.getpid).result() != os.getpid(), __file__)
"""


def test_processes_do_not_import_the_main_script(tmp_path: Path) -> None:
    script = tmp_path / "says_when_imported.py"
    script.write_text(SAYS_WHEN_IMPORTED)
    said, _ = python(str(script)).communicate()
    assert said.split() == ["imported", "True", str(script)]


def test_a_helper_answers_and_ends_quietly_when_its_connection_is_closed():
    process, orders = helper_process(double)
    orders.send(3)
    assert orders.recv() == 6
    orders.close()
    process.join(30.0)
    assert process.exitcode == 0
