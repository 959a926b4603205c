"""The live page of what runs: what it reads, and what a browser shows of a real diagnosis."""

import json
import os
import re
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from robotcast.measurements.reader import read_measurement_set, write_measurement_set
from robotcast.running import Run, followed, read_runs, say, write_page
from robotcast.watch import pipeline, watch_page

ROOT = Path(__file__).resolve().parents[1]
CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
PATIENCE_MS = 600_000
EFFECTS = ROOT / "conf" / "effects.yaml"


def test_a_command_is_followed_from_its_beginning_to_its_end(tmp_path: Path) -> None:
    folder = tmp_path / "running"
    with followed(folder, "tune", ["cable=cable1"]):
        say(title="tune", begun_s=time.time() - 10, done=1, total=3)
        write_page(tmp_path / "page.html", "<title>page</title>")
        (run,) = read_runs(folder)
        assert run.runs and run.page == str(tmp_path / "page.html")
        assert run.left_s == pytest.approx(20, abs=1)
    with pytest.raises(KeyboardInterrupt), followed(folder, "tune", ["cable=cable2"]):
        raise KeyboardInterrupt
    failed, ended = read_runs(folder)
    assert (ended.status, failed.status) == (0, 1) and not failed.runs
    say(done=2)  # outside of a command nothing is written
    assert read_runs(folder) == [failed, ended]


def test_a_killed_command_does_not_run(tmp_path: Path) -> None:
    gone = subprocess.Popen(["true"])
    gone.wait()
    run = Run("tune", [], gone.pid, time.time())
    assert not run.runs and run.status is None


TWO_STAGES = """
stages:
  first:
    cmd: python src/first.py seed=1
    deps: [src/first.py]
    params: [{conf.yaml: [seed]}]
    outs: [one]
  second:
    cmd: python src/second.py
    deps: [conf.yaml, src/second.py, one]
    outs: [two]
"""


@pytest.fixture
def two_stages(tmp_path: Path) -> Path:
    """A pipeline of two stages, `first` run."""
    for path, text in {
        "conf.yaml": "seed: 1",
        "src/first.py": "open('one', 'w').write('1')",
        "src/second.py": "open('two', 'w').write(open('one').read())",
        "dvc.yaml": TWO_STAGES,
    }.items():
        (tmp_path / path).parent.mkdir(exist_ok=True)
        (tmp_path / path).write_text(text)
    for command in ("init --no-scm --quiet", "repro --quiet first"):
        dvc(tmp_path, command)
    return tmp_path


def dvc(folder: Path, command: str) -> None:
    subprocess.run([sys.executable, "-m", "dvc", *command.split()], cwd=folder, check=True)


def test_the_pipeline_stands_as_far_as_its_files_and_its_lock_agree(two_stages: Path) -> None:
    def states(*runs: Run) -> dict[str, str]:
        return {cell.name: cell.state for cell in pipeline(two_stages, runs)}

    assert states() == {"first": "done", "second": "left"}
    now = time.time()
    took = Run("second", [], os.getpid(), now - 60, now - 20, status=0)
    (_, second) = pipeline(two_stages, [took])
    assert second.needs == ("first",) and second.left_s == pytest.approx(40)
    assert states(Run("second", [], os.getpid(), now))["second"] == "running"
    assert states(Run("second", [], os.getpid(), now, status=1))["second"] == "failed"
    lock = {"write": {str(two_stages / "two"): {"pid": os.getpid(), "cmd": "dvc repro"}}}
    (two_stages / ".dvc/tmp/rwlock").write_text(json.dumps(lock))
    assert states()["second"] == "running"
    (two_stages / "src/first.py").write_text("open('one', 'w').write('2')")
    assert states() == {"first": "left", "second": "running"}
    (two_stages / ".dvc/tmp/rwlock").unlink()
    dvc(two_stages, "repro --quiet")
    assert states() == {"first": "done", "second": "done"}


def test_links_of_the_page_lead_to_files_beside_it(tmp_path: Path) -> None:
    for place in ("data/diagnosis/a&b", "reports"):
        (tmp_path / place).mkdir(parents=True)
        (tmp_path / place / "index.html").write_text(f"<title>of {place}</title>")
    page = watch_page(tmp_path, tmp_path / "data/running")
    assert 'href="data/diagnosis/a%26b/index.html"' in page and 'href="reports/index.html"' in page
    assert "of data/diagnosis/a&amp;b" in page and "Nothing runs" in page


@pytest.fixture
def page_address(tmp_path: Path) -> Iterator[str]:
    """`robotcast watch` in an empty folder."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [sys.executable, "-m", "robotcast.cli", "watch", f"watch.port={port}"]
    server = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE)
    assert server.stderr is not None
    server.stderr.readline()
    yield f"http://127.0.0.1:{port}"
    server.terminate()
    server.wait()


@pytest.fixture
def diagnosis(tmp_path: Path) -> Iterator[Callable[[], subprocess.Popen[bytes]]]:
    """Begins a small diagnosis beside the page: a few casts, two effects."""
    whole = read_measurement_set(ROOT / "examples" / "hidden_effect")
    write_measurement_set(replace(whole, trials=whole.trials[:14]), tmp_path / "casts")
    known = yaml.safe_load(EFFECTS.read_text(encoding="utf-8"))["effects"]
    others = sorted(set(known) - {"board_tilt", "camera_latency"})
    given = ("diagnose", "casts", f"exclude=[{','.join(others)}]")
    begun: list[subprocess.Popen[bytes]] = []

    def begin() -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", "robotcast.cli", *given]
        begun.append(subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.DEVNULL))
        return begun[-1]

    yield begin
    for process in begun:
        process.kill()
        process.wait()


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium on this machine")
def test_in_a_browser_the_ladder_falls_while_a_diagnosis_runs(
    tmp_path: Path, page_address: str, diagnosis: Callable[[], subprocess.Popen[bytes]]
) -> None:
    playwright = pytest.importorskip("playwright.sync_api")
    words: list[str] = []
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page()
        page.set_default_timeout(PATIENCE_MS)
        page.on("console", lambda message: words.append(message.text))
        page.on("pageerror", lambda error: words.append(str(error)))
        page.goto(page_address)
        page.get_by_text("Begin with").wait_for()
        process = diagnosis()
        page.get_by_text("diagnose runs").wait_for()
        ladder = page.frame_locator("iframe")
        ladder.get_by_label(re.compile("Error ladder of [12] models")).wait_for()
        ladder.get_by_label("Error ladder of 2 models").wait_for()
        ladder.get_by_text("−").first.wait_for()  # by so many per cent the error fell
        process.kill()
        process.wait()
        (run,) = (run for run in read_runs(tmp_path / "data/running") if run.stage == "diagnose")
        how = "was killed" if run.status is None else "ended"  # it may have been done before
        page.get_by_text(f"diagnose {how}").wait_for()
        browser.close()
    assert words == []
