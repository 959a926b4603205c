"""The tune stage as users run it: killed at any moment, it ends where an unbroken run does."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
CASTING = ROOT.parent / "shared" / "data" / "casting" / "a"
SMALL = ("scale.tune.population=8", "scale.tune.generations=8")


def start_tuning(folder: Path) -> subprocess.Popen[bytes]:
    command = [sys.executable, "stages/tune.py", f"paths.measurements={CASTING}"]
    paths = [f"paths.tuned={folder / 'tuned'}", f"paths.unfinished={folder / 'unfinished'}"]
    return subprocess.Popen([*command, *paths, *SMALL], cwd=ROOT, stderr=subprocess.DEVNULL)


@pytest.mark.slow
@pytest.mark.skipif(not CASTING.exists(), reason="needs ../shared/data/casting")
def test_a_tuning_killed_at_random_moments_gives_the_bytes_of_an_unbroken_one(
    tmp_path: Path,
) -> None:
    unbroken, killed = tmp_path / "unbroken", tmp_path / "killed"
    assert start_tuning(unbroken).wait() == 0
    random = np.random.default_rng(5)
    kills = 0
    for seconds in random.uniform(3.0, 7.0, size=4):
        process = start_tuning(killed)
        try:
            process.wait(timeout=seconds)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            kills += 1
    assert start_tuning(killed).wait() == 0
    for name in ("tuned.yaml", "trace.csv", "predictions.parquet"):
        assert (killed / "tuned" / name).read_bytes() == (unbroken / "tuned" / name).read_bytes()
    assert not list((killed / "unfinished").glob("*.jsonl"))
    assert kills
