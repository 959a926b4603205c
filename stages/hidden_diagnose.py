"""Diagnose every set of the hidden-effect benchmark; a finished diagnosis is not done again."""

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from omegaconf import DictConfig
from stage import bar, stage

from robotcast.hidden_effects.layout import diagnosis_folder, measured_sets

ROOT = Path(__file__).resolve().parents[1]


def hidden_diagnose(config: DictConfig) -> None:
    folder = Path(config.hidden_effects.folder)
    sets = measured_sets(folder)
    with bar("diagnose sets") as progress:
        for done, measurements in enumerate(sets):
            progress(done, len(sets), measurements.name)
            output = diagnosis_folder(measurements.name, folder)
            if not _finished(output):
                _diagnose(measurements, output, config.exclude)
        progress(len(sets), len(sets))


def _finished(output: Path) -> bool:
    path = output / "diagnosis.json"
    return path.exists() and json.loads(path.read_text(encoding="utf-8"))["finished"]


def _diagnose(measurements: Path, output: Path, exclude: Sequence[str]) -> None:
    """Run the stage that a user runs, in a process that never opens an answer."""
    command = [sys.executable, str(ROOT / "stages" / "diagnose.py")]
    command += [f"measurements={measurements}", f"output={output}"]
    command += [f"exclude=[{','.join(exclude)}]"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        raise ValueError(f"{measurements} could not be diagnosed: {done.stderr[-400:]}")


if __name__ == "__main__":
    stage(hidden_diagnose)()
