"""Stages as users run them, and what is configured."""

import subprocess
import sys
from pathlib import Path

from hydra import compose, initialize_config_dir
from omegaconf import DictConfig

ROOT = Path(__file__).resolve().parents[1]


def configured(*overrides: str) -> DictConfig:
    with initialize_config_dir(str(ROOT / "conf"), version_base=None):
        return compose("config", list(overrides))


def run_stage(name: str, *settings: str) -> tuple[int, str]:
    """Run a stage; return its exit status and what it said on standard error, in one line."""
    command = [sys.executable, f"stages/{name}.py", *settings]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert "Traceback" not in done.stderr
    return done.returncode, " ".join(done.stderr.split())
