"""The tune stage as users run it: killed at any moment, it ends where an unbroken run does."""

import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.stages import ROOT, run_stage

CASTING = ROOT / "examples" / "hidden_effect"
SMALL = ("optimizer=gn", "optimizer.search.members=12", "optimizer.budget_casts=1500")


def start_tuning(folder: Path) -> subprocess.Popen[bytes]:
    command = [sys.executable, "stages/tune.py", f"paths.measurements={CASTING}", *SMALL]
    paths = [f"paths.tuned={folder / 'tuned'}", f"paths.unfinished={folder / 'unfinished'}"]
    return subprocess.Popen([*command, *paths], cwd=ROOT, stderr=subprocess.DEVNULL)


def journal_batches(folder: Path) -> int:
    """Count the responses in the journal: two lines each, after a head."""
    journals = list((folder / "unfinished").glob("[!.]*.jsonl"))
    return sum(len(journal.read_bytes().splitlines()) // 2 for journal in journals)


@pytest.mark.slow
def test_a_tuning_killed_twice_gives_the_bytes_of_an_unbroken_one(tmp_path: Path) -> None:
    unbroken, killed = tmp_path / "unbroken", tmp_path / "killed"
    assert start_tuning(unbroken).wait() == 0
    for batches in (1, 5):
        process = start_tuning(killed)
        try:
            while process.poll() is None and journal_batches(killed) < batches:
                time.sleep(0.01)
            assert process.poll() is None, "the tuning ended before it could be killed"
        finally:
            process.kill()
            process.wait()
    assert start_tuning(killed).wait() == 0
    names = ("tuned.yaml", "trace.csv", "predictions.parquet", "revision.json")
    for name in (*(f"tuned/{name}" for name in names), "revisions.jsonl", "revisions.html"):
        assert (killed / name).read_bytes() == (unbroken / name).read_bytes(), name
    assert not list((killed / "unfinished").iterdir())


def test_an_unfinished_diagnosis_is_not_revised(tmp_path: Path) -> None:
    (tmp_path / "diagnosis.json").write_text('{"finished": false, "model": {}}')
    status, said = run_stage("revise", f"paths.diagnosis={tmp_path}", f"paths.running={tmp_path}")
    assert status == 2
    assert "is unfinished; the same diagnosis goes on from where it stopped" in said
