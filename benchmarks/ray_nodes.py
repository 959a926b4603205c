"""A sweep and a sharded D_sim on a Ray cluster of two nodes, one of them killed half-way.

    python benchmarks/ray_nodes.py --measurements DIR --tuned DIR

It needs the extra `ray`. Both nodes are processes of this machine, on loopback. The second one is
killed when the first job has ended; its jobs go to the other. What the cluster wrote is compared,
byte by byte, with the same jobs run one after the other without it. Exits with 1 when a file
differs.
"""

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
RAY = Path(sys.executable).with_name("ray")
PORT = 6399
SEEDS = (1, 2, 3, 4)
SHARDS = 4
ONE_CORE = "++simulator.model.settings.processes=1"
BUDGET = "scale.tune.segmented.budget_casts.de=800"
GRID = "scale.generate.grid={theta1:5,theta2:5,r2:4,alpha:4,vmax:2}"
ON_RAY = "hydra/launcher=ray"


os.environ["RAY_AUTH_MODE"] = "token"  # which nodes ask for, and all commands must then say


def node(*given: str) -> subprocess.Popen[bytes]:
    """Start a Ray node of one core."""
    command = [str(RAY), "start", "--block", "--num-cpus=1", "--disable-usage-stats", *given]
    quiet = subprocess.DEVNULL
    return subprocess.Popen(command, cwd=ROOT, stdout=quiet, stderr=quiet)


def kill(process: subprocess.Popen[bytes]) -> None:
    """Kill a node at once with all its processes, as a machine that loses power."""
    for pid in [process.pid, *descendants(process.pid)]:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    process.wait()


def descendants(pid: int) -> list[int]:
    """Return the children of a process, and theirs: a node's daemons have sessions of their own."""
    listed = subprocess.run(["ps", "-eo", "pid=,ppid="], capture_output=True, text=True, check=True)
    parents = [tuple(map(int, line.split())) for line in listed.stdout.splitlines()]
    found = [pid]
    for one in found:
        found += [child for child, parent in parents if parent == one]
    return found[1:]


def stage(name: str, *given: str) -> list[str]:
    return [sys.executable, str(ROOT / "stages" / f"{name}.py"), *given]


def run(command: Sequence[str]) -> None:
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{' '.join(command)}: {done.stderr[-2000:]}")


def on_the_cluster(command: Sequence[str], folder: Path, wanted: str, jobs: int) -> None:
    """Run a sweep on both nodes; kill the second one when the first file `wanted` is there."""
    head = node("--head", f"--port={PORT}", "--node-ip-address=127.0.0.1")
    asked = [str(RAY), "status", f"--address=127.0.0.1:{PORT}"]
    while subprocess.run(asked, capture_output=True).returncode:
        time.sleep(2)
    second = node(f"--address=127.0.0.1:{PORT}")
    time.sleep(8)
    try:
        sweep = subprocess.Popen(
            command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
        )
        while sweep.poll() is None and not list(folder.rglob(wanted)):
            time.sleep(0.2)
        done = len(list(folder.rglob(wanted)))
        kill(second)
        print(f"  a node was killed with {done} of {jobs} jobs done", flush=True)
        said, _ = sweep.communicate()
        if sweep.returncode:
            raise SystemExit(f"{' '.join(command)}: {said.decode()[-3000:]}")
    finally:
        for one in (second, head):
            if one.poll() is None:
                kill(one)
        subprocess.run([str(RAY), "stop", "--force"], capture_output=True, check=False)


def compared(one: Path, other: Path) -> int:
    """Print how many files of two folders differ, and return it."""
    files = sorted(path.relative_to(one) for path in one.rglob("*") if path.is_file())
    there = sorted(path.relative_to(other) for path in other.rglob("*") if path.is_file())
    same = files == there
    differ = [f for f in files if not same or (one / f).read_bytes() != (other / f).read_bytes()]
    print(f"  {len(files)} files, {len(differ)} differ", flush=True)
    return len(differ) + (not files)


def sweep(measurements: Path, folder: Path) -> int:
    """Tune with four seeds, on the cluster and without it."""
    print("sweep: four seeds", flush=True)
    given = (f"paths.measurements={measurements}", ONE_CORE, BUDGET)
    for seed in SEEDS:
        place = f"paths.tuned={folder}/alone/seed-{seed}"
        run(stage("tune", *given, f"optimizer.seed={seed}", place, f"paths.unfinished={folder}/a"))
    seeds = f"optimizer.seed={','.join(map(str, SEEDS))}"
    swept = ("-m", ON_RAY, f"hydra.sweep.dir={folder}/ray", f"paths.unfinished={folder}/b")
    swept = (*swept, "hydra.sweep.subdir=seed-${optimizer.seed}")
    on_the_cluster(stage("tune", *swept, *given, seeds), folder / "ray", "tuned.yaml", len(SEEDS))
    places = [f"seed-{seed}" for seed in SEEDS]
    return sum(compared(folder / "alone" / place, folder / "ray" / place) for place in places)


def shards(measurements: Path, tuned: Path, folder: Path) -> int:
    """Generate D_sim in shards on the cluster, merge them, and generate it in one piece."""
    print(f"D_sim: {SHARDS} shards", flush=True)
    given = (f"paths.measurements={measurements}", f"paths.tuned={tuned}", ONE_CORE, GRID)
    run(stage("generate", *given, f"paths.simulated={folder}/whole"))
    cut = (f"generate.shards={SHARDS}", f"paths.shards={folder}/shards")
    swept = ("-m", ON_RAY, f"hydra.sweep.dir={folder}/jobs")
    command = stage("generate", *swept, *given, *cut, f"generate.shard=range({SHARDS})")
    on_the_cluster(command, folder / "shards", "generation.yaml", SHARDS)
    run(stage("generate", *cut, f"paths.simulated={folder}/merged"))
    return compared(folder / "whole", folder / "merged")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--measurements", type=Path, required=True)
    parser.add_argument("--tuned", type=Path, required=True)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder, measurements = Path(temporary), asked.measurements.resolve()
        differ = shards(measurements, asked.tuned.resolve(), folder / "d_sim")
        differ += sweep(measurements, folder / "sweep")
    sys.exit(1 if differ else 0)


if __name__ == "__main__":
    main()
