"""Kill collect and tune at random moments, and compare what they end with to an unbroken run.

    .venv/bin/python benchmarks/kills.py [--kills 10] [--measurements DIR] [--only collect]

Every kill is a SIGKILL while the stage is at work. What was finished before must stand unchanged
after the next start, and the last run must end with the bytes of a run without kills. Exits with
1 where that is not so.
"""

import argparse
import hashlib
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
MEASUREMENTS = ROOT / "examples" / "hidden_effect"

Standing = dict[str, str]  # what of a stage's work is finished: its name → a digest of its bytes


@dataclass(frozen=True)
class Stage:
    """A stage to kill."""

    name: str
    overrides: Callable[[Path], list[str]]  # of its configuration, given its folder
    finished: Callable[[Path], Standing]  # what is finished in a folder
    output: str  # the folder whose bytes count in the end

    def start(self, folder: Path) -> subprocess.Popen[bytes]:
        """Start it on a folder."""
        command = [sys.executable, f"stages/{self.name}.py", *self.overrides(folder)]
        return subprocess.Popen(
            command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )


def collect_overrides(folder: Path) -> list[str]:
    return [f"paths.sessions={folder / 'session'}", "scale.collect={casts:24,repeats:6}"]


def tune_overrides(measurements: Path, folder: Path) -> list[str]:
    paths = [f"paths.tuned={folder / 'tuned'}", f"paths.unfinished={folder / 'unfinished'}"]
    return [f"paths.measurements={measurements}", *paths]


def finished_casts(folder: Path) -> Standing:
    """Return the finished casts with a digest of all their files."""
    casts = sorted((folder / "session").glob("cast_*"))
    return {cast.name: "".join(digests(cast).values()) for cast in casts}


def finished_batches(folder: Path) -> Standing:
    """Return the lines of the journal, after its first in pairs; a torn pair does not count."""
    lines: list[bytes] = []
    for journal in (folder / "unfinished").glob("[!.]*.jsonl"):
        written = journal.read_bytes().split(b"\n")[:-1]
        lines += written if len(written) % 2 else written[:-1]
    return {str(k): hashlib.sha256(line).hexdigest() for k, line in enumerate(lines)}


def digests(folder: Path) -> Standing:
    """Return the digest of every file below a folder."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest() for p in files}


def run_unbroken(stage: Stage, folder: Path) -> tuple[float, float]:
    """Run it to its end; return when its first piece was finished, and when it ended [s]."""
    started, first_s = time.monotonic(), None
    process = stage.start(folder)
    while process.poll() is None:
        if first_s is None and stage.finished(folder):
            first_s = time.monotonic() - started
        time.sleep(0.05)
    if process.returncode or first_s is None:
        raise SystemExit(f"{stage.name} failed without any kill")
    return first_s, time.monotonic() - started


def run_killed(
    stage: Stage, folder: Path, first_s: float, end_s: float, kills: int, seed: int
) -> bool:
    """Kill it so many times, then let it end; tell whether nothing finished was ever lost."""
    rng, whole, done = np.random.default_rng(seed), True, 0
    span_s = 1.5 * (end_s - first_s) / kills
    while done < kills:
        process, before = stage.start(folder), stage.finished(folder)
        try:
            process.wait(first_s + rng.uniform(0, span_s))
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        else:
            print(f"  ended after {done} kills")
            return whole
        done += 1
        after = stage.finished(folder)
        lost = [name for name, digest in before.items() if after.get(name) != digest]
        whole = whole and not lost
        print(f"  kill {done}: {len(after)} finished, {len(after) - len(before)} since the last")
        if lost:
            print(f"  lost or changed: {', '.join(lost)}")
    return stage.start(folder).wait() == 0 and whole


def judge(stage: Stage, folder: Path, kills: int, seed: int) -> bool:
    """Compare a killed run with an unbroken one; tell whether they are equal."""
    print(stage.name)
    first_s, end_s = run_unbroken(stage, folder / "unbroken")
    whole = run_killed(stage, folder / "killed", first_s, end_s, kills, seed)
    outputs = [digests(folder / name / stage.output) for name in ("unbroken", "killed")]
    differ = [name for name in outputs[0] | outputs[1] if len({o.get(name) for o in outputs}) > 1]
    print(f"  {len(outputs[0])} files, {len(differ)} differ {' '.join(differ)}")
    return whole and not differ


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--measurements", type=Path, default=MEASUREMENTS)
    parser.add_argument("--only", choices=("collect", "tune"))
    asked = parser.parse_args()
    measurements = asked.measurements.resolve()
    stages = (
        Stage("collect", collect_overrides, finished_casts, "session"),
        Stage("tune", lambda f: tune_overrides(measurements, f), finished_batches, "tuned"),
    )
    with tempfile.TemporaryDirectory() as folder:
        good = [
            judge(stage, Path(folder) / stage.name, asked.kills, asked.seed)
            for stage in stages
            if asked.only in (None, stage.name)
        ]
    raise SystemExit(0 if all(good) else 1)


if __name__ == "__main__":
    main()
