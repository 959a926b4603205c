"""Diagnose every set of the hidden-effect benchmark; a finished diagnosis is not done again."""

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from omegaconf import DictConfig
from stage import bar, stage

from robotcast.files import write_text
from robotcast.hidden_effects.layout import diagnosis_path, measured_sets, pages_folder

ROOT = Path(__file__).resolve().parents[1]


def hidden_diagnose(config: DictConfig) -> None:
    settings = config.hidden_effects
    folder, reports = Path(settings.folder), Path(settings.reports)
    sets = measured_sets(folder, settings.cases)
    with bar("diagnose sets") as progress:
        for done, measurements in enumerate(sets):
            progress(done, len(sets), measurements.name)
            path = diagnosis_path(measurements.name, reports)
            if not path.exists():
                output = pages_folder(measurements.name, folder)
                _diagnose(measurements, output, config.exclude)
                write_text(path, _said(output))
        progress(len(sets), len(sets))


def _said(output: Path) -> str:
    """Return what was said, as JSON, without every cast's path, which only its page needs."""
    said = json.loads((output / "diagnosis.json").read_text(encoding="utf-8"))
    return json.dumps({**said, "comparison": None}, ensure_ascii=False, indent=1)


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
