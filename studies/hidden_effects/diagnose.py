"""Diagnose every set of the hidden-effect benchmark; a finished diagnosis is not done again."""

import json
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from robotcast.build import CONFIGURATION
from robotcast.files import write_text
from robotcast.stage import bar, stage
from studies.hidden_effects.layout import measured_sets, result


def diagnose(config: DictConfig) -> None:
    settings = config.hidden_effects
    sets = measured_sets(Path(settings.folder), settings.cases)
    with bar("diagnose sets") as progress:
        for done, measurements in enumerate(sets):
            progress(done, len(sets), measurements.name)
            path = result("diagnoses", measurements.name, Path(settings.reports))
            if not path.exists():
                output = Path(settings.folder) / "diagnoses" / measurements.name
                began = time.monotonic()
                said = diagnosed(measurements, output, config.exclude)
                # without every cast's path, which only its page needs
                said |= {"comparison": None, "seconds": round(time.monotonic() - began, 1)}
                write_text(path, json.dumps(said, ensure_ascii=False, indent=1))
        progress(len(sets), len(sets))


def diagnosed(measurements: Path, output: Path, exclude: Sequence[str]) -> dict[str, Any]:
    """Run the stage that a user runs, in a process that never opens an answer; return its JSON."""
    command = [sys.executable, "stages/diagnose.py", f"measurements={measurements}"]
    command += [f"output={output}", f"exclude=[{','.join(exclude)}]"]
    done = subprocess.run(command, cwd=CONFIGURATION.parent, capture_output=True, text=True)
    if done.returncode:
        raise ValueError(f"{measurements} could not be diagnosed: {done.stderr[-400:]}")
    return json.loads((output / "diagnosis.json").read_text(encoding="utf-8"))


if __name__ == "__main__":
    stage(diagnose)()
