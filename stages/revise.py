"""Tune the simulator again with the effects that a diagnosis names, none where it names none.

python stages/revise.py paths.diagnosis=DIR paths.tuned=DIR
"""

import json
from pathlib import Path

from omegaconf import DictConfig

from robotcast.stage import stage, tell
from robotcast.workflow.tuning import tune_simulator


def revise(config: DictConfig) -> None:
    path = Path(config.paths.diagnosis) / "diagnosis.json"
    if not path.is_file():
        raise ValueError(f"{path}: is not there; stages/diagnose.py writes it")
    said = json.loads(path.read_text(encoding="utf-8"))
    if not said["finished"]:
        raise ValueError(f"{path}: is unfinished; the same diagnosis goes on from where it stopped")
    config.effects = said["model"].get("effects", [])  # no model where the casts were too few
    folder, tuned = tune_simulator(config)
    named = ", ".join(config.effects) or "no effect"
    error = tuned.errors["test"].waypoint_percent
    tell(f"{folder}: with {named}, test casts {error:.2f} % average waypoint, of cable length")


if __name__ == "__main__":
    stage(revise)()
