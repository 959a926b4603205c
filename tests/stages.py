"""Stages as users run them."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def run_stage(name: str, *settings: str) -> tuple[int, str]:
    """Run a stage; return its exit status and what it said on standard error, in one line."""
    command = [sys.executable, f"stages/{name}.py", *settings]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert "Traceback" not in done.stderr
    return done.returncode, " ".join(done.stderr.split())
