"""The pipeline's stages on the loopback UR5: from 30 casts to a policy that casts on it.

    python benchmarks/ur5_stages.py

Runs the very commands of the README, collect to evaluate, with rig=ur5: the genuine ur_rtde client
against tests/rigs/peer, whose camera films the virtual rig's board and cable of the configuration.
Exits with 1 when a stage fails or the policy's casts end too far from their targets.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
from hydra import compose, initialize_config_dir

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))  # for tests/
# ruff: noqa: E402

from robotcast.build import build_rig
from tests.rigs.peer.controller import Settings
from tests.rigs.peer.lab import GRIPPER, HOME_RAD
from tests.rigs.peer.process import running_peer

SIZE = ("scale.camera.width=960", "scale.camera.height=540", "camera.picture.fps=30")
# A busy machine shall not stop the arm: the peer waits for the next target, and so does the watch.
CONTROLLER = Settings(HOME_RAD, patience_s=3.0, haste=3.0)
PATIENT = ("rig.watch.stale_s=8",)
MOST_PERCENT = 20.0  # of so few casts
STAGES = ("collect", "track", "tune", "generate", "candidates", "train", "evaluate")
CASTING = ("collect", "evaluate")
FOLDERS = (
    *("sessions", "measurements", "tuned", "simulated"),
    *("policy", "evaluation", "evaluation_sessions"),
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--casts", type=int, default=24)
    parser.add_argument("--repeats", type=int, default=6)
    parser.add_argument("--targets", type=int, default=4)
    parser.add_argument("--folder", help="to keep what the stages write; they go on from there")
    asked = parser.parse_args()
    with initialize_config_dir(str(ROOT / "conf"), version_base=None):
        filmed = build_rig(compose("config", list(SIZE)))
    filmed = replace(filmed, gripper=GRIPPER)  # that the arm really has
    with (
        running_peer(CONTROLLER, filmed) as peer,
        tempfile.TemporaryDirectory() as passing,
    ):
        folder = asked.folder or passing
        robot = (
            *(f"rig.host={peer.host}", f"rig.camera={peer.camera}", "rig.confirm=yes"),
            *("rig.width=960", "rig.height=540", "rig.fps=30", *PATIENT),
        )
        common = (
            "rig=ur5",
            "session=loopback",
            *SIZE,
            *(f"paths.{name}={folder}/{name}" for name in FOLDERS),
            f"paths.candidates={folder}/candidates.csv",
            f"scale.collect.casts={asked.casts}",
            f"scale.collect.repeats={asked.repeats}",
            f"scale.tune.tune_casts={asked.casts // 2}",
            f"scale.tune.test_casts={asked.casts // 3}",
            f"scale.evaluate.targets={asked.targets}",
            "scale.evaluate.repeats=1",
        )
        for name in STAGES:
            command = [sys.executable, str(ROOT / "stages" / f"{name}.py"), *common]
            command += robot if name in CASTING else ()
            begun = time.monotonic()
            done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
            last = [line for line in (done.stdout + done.stderr).splitlines() if line.strip()][-3:]
            print(f"{name}: exit {done.returncode} in {time.monotonic() - begun:.0f} s", flush=True)
            print("".join(f"  {line}\n" for line in last), flush=True)
            if done.returncode:
                raise SystemExit(1)
        table = pl.read_csv(Path(folder) / "evaluation" / "evaluation.csv")
        median = float(np.median(table["error_percent"].drop_nulls().to_numpy()))
        print(f"median {median:.1f} % of cable length (asked: ≤ {MOST_PERCENT:.0f})")
        raise SystemExit(0 if median <= MOST_PERCENT else 1)


if __name__ == "__main__":
    main()
