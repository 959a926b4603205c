"""A pool of processes does not outlive the work it was opened for."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import wait
from pathlib import Path

import pytest

from robotcast.pool import process_pool

OPENS_A_POOL = """
import os, time
from robotcast.pool import process_pool
if __name__ == "__main__":
    with process_pool(1) as pool:
        print(pool.submit(os.getpid).result(), flush=True)
        time.sleep(60)
"""


def note(folder: Path, number: int) -> None:
    time.sleep(0.1)
    (folder / str(number)).touch()


def test_an_interrupt_drops_what_is_queued_and_ends_what_is_under_way(tmp_path):
    def interrupted() -> None:
        with process_pool(2) as pool:
            queued = [pool.submit(note, tmp_path, number) for number in range(60)]
            wait(queued[:1])
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert 1 <= len(list(tmp_path.iterdir())) < 12


def test_a_terminal_interrupts_the_one_who_opened_the_pool_alone():
    with process_pool(1) as pool:
        worker = pool.submit(os.getpid).result()
        os.kill(worker, signal.SIGINT)
        assert pool.submit(os.getpid).result() == worker


def test_its_processes_end_with_the_one_that_was_killed(tmp_path):
    script = tmp_path / "opens_a_pool.py"
    script.write_text(OPENS_A_POOL)
    with subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        worker = int(process.stdout.readline())
        assert Path(f"/proc/{worker}").exists()
        process.kill()
    until = time.monotonic() + 20.0
    while _runs(worker):
        assert time.monotonic() < until
        time.sleep(0.05)


SAYS_WHEN_IMPORTED = """
import os
from robotcast.pool import process_pool
print("imported", flush=True)
if __name__ == "__main__":
    with process_pool(1) as pool:
        print(pool.submit(os.getpid).result() != os.getpid(), __file__)
"""


def test_its_processes_do_not_import_the_main_script(tmp_path):
    script = tmp_path / "says_when_imported.py"
    script.write_text(SAYS_WHEN_IMPORTED)
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["imported", "True", str(script)]


def _runs(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except FileNotFoundError:
        return False
    return state != "Z"
